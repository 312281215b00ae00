// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/renderer_selector.h"

#include "lib/render/sum_arrays.h"
#include "render/ownership.h"
#include "support/process.h"
#include "support/test.h"

namespace lf {
namespace {

TEST(RendererTuner, FasterRendererWins) {
  for (const uint64_t gpu_ns : {500, 2000}) {
    RendererTuner race;
    int turns[2] = {};
    while (!race.decided()) {
      const bool gpu = race.gpu_is_next();
      // The GPU compiles its programs first. Half of the CPU's answers are delayed by other work.
      race.add(gpu, 1000, gpu ? (turns[1] == 0 ? 1000000 : gpu_ns) : turns[0] % 2 ? 1000 : 90000);
      ASSERT_LE(++turns[gpu], RendererTuner::kRounds + 1);
    }
    EXPECT_EQ(turns[0], RendererTuner::kRounds);
    EXPECT_EQ(turns[1], RendererTuner::kRounds + 1);
    EXPECT_EQ(race.gpu_is_next(), gpu_ns < 1000);
    race.add(true, 1000, 1);
    EXPECT_EQ(race.gpu_is_next(), gpu_ns < 1000);
    EXPECT_EQ(race.best(true), static_cast<double>(gpu_ns) / 1000);
  }
}

TEST(RendererTuner, Restarts) {
  RendererTuner race;
  for (int i = 0; i < 3; i++) race.add(true, 1000, 10);
  race.begin_again();
  EXPECT_EQ(race.best(true), std::numeric_limits<double>::infinity());
  race.add(true, 1000, 1);
  EXPECT_EQ(race.best(true), std::numeric_limits<double>::infinity()) << "programs are compiled again";
  race.add(true, 1000, 2000);
  EXPECT_EQ(race.best(true), 2);
}

TEST(RendererTuner, NeedsSamplesOfBoth) {
  RendererTuner race;
  for (int i = 0; i < 100; i++) race.add(false, 1000, 1000);
  EXPECT_FALSE(race.decided());
  EXPECT_TRUE(race.gpu_is_next());
  race.add(true, 0, 1000);
  EXPECT_EQ(race.best(true), std::numeric_limits<double>::infinity());
}

RenderedAnswer answer(bool drawn, const std::string& refused_why = "") {
  return {.drawing = {drawn, !refused_why.empty(), refused_why}, .pixels = 1000, .render_ns = 1000};
}

TEST(RendererSelector, PausesAfterRefusals) {
  constexpr uint64_t kSecond = 1'000'000'000;
  uint64_t now = 77 * kSecond;
  RendererSelector gpu(gl::GlesRenderer::create, [&] { return now; });
  std::string news;
  const std::shared_ptr<gl::GlesRenderer> drawer = gpu.open(RendererChoice::kGl, news);
  ASSERT_TRUE(drawer) << news;
  const std::string draws = "gl: " + drawer->device();
  const auto refuse = [&](const std::string& why) {
    EXPECT_EQ(gpu.open(RendererChoice::kGl, news), drawer);
    gpu.rendered(RendererChoice::kGl, answer(false, why));
    EXPECT_EQ(news, "");
    EXPECT_MENTIONS(gpu.explain(RendererChoice::kGl), "cpu", drawer->device(), why);
  };
  for (int i = 0; i < 2; i++) {
    refuse("too large");
    refuse("too large");
    gpu.rendered(RendererChoice::kGl, answer(true));  // at most two in a row
    EXPECT_EQ(gpu.explain(RendererChoice::kGl), draws);
  }
  for (int i = 0; i < 3; i++) refuse("too large");
  for (int i = 0; i < 10; i++, now += kSecond) {
    EXPECT_EQ(gpu.open(RendererChoice::kGl, news), nullptr) << i;
    if (i > 0)
      EXPECT_EQ(news, "");
    else
      EXPECT_MENTIONS(news, drawer->device(), "CPU", "too large");
    news.clear();
    gpu.rendered(RendererChoice::kGl, answer(false));
    EXPECT_MENTIONS(gpu.explain(RendererChoice::kGl), "cpu", drawer->device(), "large");
  }
  refuse("too large");  // the third in a row
  for (int i = 0; i < 10; i++, now += kSecond) EXPECT_EQ(gpu.open(RendererChoice::kGl, news), nullptr) << i;
  EXPECT_EQ(news, "") << "already reported";
  EXPECT_EQ(gpu.open(RendererChoice::kGl, news), drawer);
  gpu.rendered(RendererChoice::kGl, answer(true));
  EXPECT_EQ(gpu.explain(RendererChoice::kGl), draws);
}

// Refused hypotheses pause GPU hypotheses only, independent of answers.
TEST(RendererSelector, RendersHypothesesAndSeveralViews) {
  uint64_t now = 1;
  const auto open = [](gl::Context::Drivers, std::string& why) {
    return gl::GlesRenderer::create(gl::Context::Drivers::kAny, why);
  };
  RendererSelector gpu(open, [&] { return now; });
  std::string news;
  EXPECT_EQ(gpu.open_for_depth(RendererChoice::kGl), nullptr) << "already open for answers";
  EXPECT_FALSE(gpu.can_batch(RendererChoice::kGl));
  const std::shared_ptr<gl::GlesRenderer> drawer = gpu.open(RendererChoice::kGl, news);
  ASSERT_TRUE(drawer) << news;
  EXPECT_EQ(gpu.open_for_depth(RendererChoice::kCpu), nullptr);
  EXPECT_EQ(gpu.open_for_depth(RendererChoice::kGl), drawer);
  EXPECT_TRUE(gpu.can_batch(RendererChoice::kGl));
  EXPECT_FALSE(gpu.can_batch(RendererChoice::kCpu));
  EXPECT_FALSE(gpu.can_batch(RendererChoice::kAuto)) << "not decided yet";
  if (drawer->is_software()) {
    EXPECT_EQ(gpu.open_for_depth(RendererChoice::kAuto), nullptr);
  }
  const std::string draws = "gl: " + drawer->device();
  gpu.rendered(RendererChoice::kGl, answer(true));
  EXPECT_EQ(gpu.explain(RendererChoice::kGl), draws);
  gpu.tried(RendererChoice::kGl, {.unit = {}, .drawing = {.drawn = true, .why_not = ""}, .nodes = 100, .ns = 1});
  gpu.tried(RendererChoice::kGl, {});  // an answer without hypotheses gives no information
  EXPECT_EQ(gpu.explain(RendererChoice::kGl), draws + ", photo-consistency, too");
  for (int i = 0; i < Backoff::kMaxRefusals; i++) {
    EXPECT_EQ(gpu.open_for_depth(RendererChoice::kGl), drawer);
    gpu.tried(RendererChoice::kGl, {.unit = {}, .drawing = {.refused = true, .why_not = "too large"}, .nodes = 100});
  }
  EXPECT_EQ(gpu.open_for_depth(RendererChoice::kGl), nullptr);
  EXPECT_EQ(gpu.open(RendererChoice::kGl, news), drawer);
  EXPECT_EQ(gpu.explain(RendererChoice::kGl), draws);
  now += Backoff::kRest;
  EXPECT_EQ(gpu.open_for_depth(RendererChoice::kGl), drawer);
  EXPECT_EQ(news, "");
}

// Moves once to the context of the pictures if a renderer exists there; users of the previous renderer may finish.
TEST(RendererSelector, MovesToAnotherContext) {
  RendererSelector gpu;
  std::string news, why;
  int opened = 0;
  constexpr gl::ShareGroup kHere = 7, kThere = 8;
  // Contexts without an owner are accepted as well.
  const RendererSelector::OpenIn open = [&](std::string& reason) {
    opened++;
    return gl::GlesRenderer::create(gl::Context::Drivers::kAny, reason);
  };
  const RendererSelector::OpenIn fail = [&](std::string& reason) {
    opened++;
    reason = "no more of them";
    return std::unique_ptr<gl::GlesRenderer>();
  };
  gpu.move_to(RendererChoice::kGl, kHere, false, open, why);
  EXPECT_EQ(opened, 0) << "nothing draws yet";
  const std::shared_ptr<gl::GlesRenderer> before = gpu.open(RendererChoice::kGl, news);
  ASSERT_TRUE(before) << news;
  gpu.move_to(RendererChoice::kCpu, kHere, false, open, why);
  gpu.move_to(RendererChoice::kAuto, kHere, false, open, why);
  EXPECT_EQ(opened, 0) << "auto has not decided yet";
  for (int i = 0; i < 3; i++) gpu.move_to(RendererChoice::kGl, kHere, false, open, why);
  EXPECT_EQ(opened, 1);
  const std::shared_ptr<gl::GlesRenderer> after = gpu.open(RendererChoice::kGl, news);
  EXPECT_TRUE(after);
  EXPECT_NE(after, before);
  for (int i = 0; i < 3; i++) gpu.move_to(RendererChoice::kGl, kThere, false, fail, why);
  EXPECT_EQ(opened, 2);
  EXPECT_EQ(why, "no more of them");
  gpu.move_to(RendererChoice::kGl, kHere, false, open, why);
  EXPECT_EQ(opened, 2) << "no repeated switching";
  EXPECT_EQ(gpu.open(RendererChoice::kGl, news), after) << "continues";
  gpu.leave();
  EXPECT_EQ(gpu.open(RendererChoice::kGl, news), after) << "not in use";
  EXPECT_EQ(news, "");
}

TEST(RendererSelector, AutoIgnoresSoftwareRenderers) {
  std::string why_not;
  const auto any = gl::GlesRenderer::create(gl::Context::Drivers::kAny, why_not);
  ASSERT_TRUE(any) << why_not;
  if (!any->is_software()) return;
  // Also if the driver misreports its kind.
  int opened = 0;
  RendererSelector gpu([&](gl::Context::Drivers drivers, std::string& why) {
    opened++;
    EXPECT_EQ(drivers, gl::Context::Drivers::kHardware);
    return gl::GlesRenderer::create(gl::Context::Drivers::kAny, why);
  });
  std::string news;
  EXPECT_MENTIONS(gpu.explain(RendererChoice::kAuto), "auto", "nothing", "yet");
  for (int i = 0; i < 3; i++) EXPECT_EQ(gpu.open(RendererChoice::kAuto, news), nullptr);
  EXPECT_EQ(opened, 1);
  EXPECT_EQ(news, "");
  EXPECT_THAT(gpu.explain(RendererChoice::kAuto), testing::HasSubstr("CPU, too"));
  EXPECT_NE(gpu.open(RendererChoice::kGl, news), nullptr);  // an explicit choice selects the software renderer
  EXPECT_EQ(opened, 1);
}

TEST(RendererSelector, ExplainsAMissingGpu) {
  int opened = 0;
  RendererSelector gpu([&](gl::Context::Drivers, std::string& why) {
    opened++;
    why = "nothing here";
    return std::unique_ptr<gl::GlesRenderer>();
  });
  std::string news;
  EXPECT_EQ(gpu.open(RendererChoice::kCpu, news), nullptr);
  EXPECT_EQ(opened, 0);
  EXPECT_EQ(gpu.open(RendererChoice::kAuto, news), nullptr);
  EXPECT_EQ(news, "");
  EXPECT_MENTIONS(gpu.explain(RendererChoice::kAuto), "auto: cpu", "nothing here");
  EXPECT_EQ(gpu.open(RendererChoice::kGl, news), nullptr);
  EXPECT_MENTIONS(news, "OpenGL ES 3.1", "CPU", "nothing here", "check");
  news.clear();
  for (const RendererChoice choice : {RendererChoice::kAuto, RendererChoice::kGl})
    EXPECT_EQ(gpu.open(choice, news), nullptr);
  EXPECT_EQ(opened, 2);
  EXPECT_EQ(news, "");
}

class GpuLossTest : public testing::Test {
 protected:
  // Renders with the GPU if available. Returns the largest difference from the CPU, of 255.
  double render(gl::GlesRenderer* gpu, bool& drawn) {
    const SumRenderer renderer(production_.plan, production_.owners.runs(), sources_, PixelFamily::kI420,
                               Coordinates::kGrid, gpu);
    const SumRenderer cpu(production_.plan, production_.owners.runs(), sources_, PixelFamily::kI420);
    drawn = renderer.drawing().drawn;
    const Rect whole = test::whole(view_);
    test::Sum a(PixelFamily::kI420, whole), b(PixelFamily::kI420, whole);
    renderer.render_rows(0, view_.height, a.planes);
    cpu.render_rows(0, view_.height, b.planes);
    int worst = 0;
    for (int c = 0; c < 3; c++)
      for (size_t i = 0; i < a.memory[c].size(); i++)
        worst = std::max(worst, std::abs(a.memory[c][i] - b.memory[c][i]));
    return worst / 128.0;
  }

  reference::Random random_{1};
  const Rig rig_ = test::jittered_array(random_, 3, 64, 48, -0.1);
  const View view_ = test::view_into(3, 64, 48, random_.small_rotation(0.1));
  const test::Production production_{rig_, build_mesh(rig_), view_};
  const std::vector<Image> images_ = test::i420_of(images_of(rig_, random_, reference::smooth_image));
  const std::vector<Source> sources_ = test::sources_of(rig_, production_.plan, images_);
};

TEST_F(GpuLossTest, TooLargeTasksAreRefusedWithTheReason) {
  RendererSelector gpu;
  std::string news;
  const std::shared_ptr<gl::GlesRenderer> drawer = gpu.open(RendererChoice::kGl, news);
  ASSERT_TRUE(drawer) << news;
  View wide = view_;
  wide.width = 1 << 16;
  wide.height = 2;
  wide.lens = Lens::pinhole(1.25 * wide.width, (wide.width - 1) / 2.0, 0.5);
  const test::Production production(rig_, build_mesh(rig_), wide);
  const std::vector<Source> sources = test::sources_of(rig_, production.plan, images_);
  const SumRenderer renderer(production.plan, production.owners.runs(), sources, PixelFamily::kI420, Coordinates::kGrid,
                             drawer.get());
  EXPECT_FALSE(renderer.drawing().drawn);
  EXPECT_TRUE(renderer.drawing().refused);
  EXPECT_MENTIONS(renderer.drawing().why_not, "view", "large");
}

// LF_CYCLES sets the number of cycles.
TEST_F(GpuLossTest, StartsAndStopsLeakNothing) {
  const char* const wanted = std::getenv("LF_CYCLES");
  const int cycles = wanted ? std::atoi(wanted) : 8;
  const auto resident = [] { return static_cast<double>(test::resident_kib()) / 1024; };
  double megabytes = 0;
  ptrdiff_t files = 0, threads = 0;
  for (int i = 0; i < cycles; i++) {
    if (i == cycles / 4) {  // permanent allocations exist by now
      megabytes = resident();
      files = test::count_of("fd");
      threads = test::count_of("task");
    }
    RendererSelector gpu;
    std::string news;
    const std::shared_ptr<gl::GlesRenderer> drawer = gpu.open(RendererChoice::kGl, news);
    ASSERT_TRUE(drawer) << news;
    bool drawn = false;
    EXPECT_LE(render(drawer.get(), drawn), 1);
    EXPECT_TRUE(drawn);
  }
  std::printf("%d cycles: %.1f MiB more than after a quarter of them\n", cycles, resident() - megabytes);
  EXPECT_LE(resident() - megabytes, 0.1 * megabytes + 8);
  EXPECT_LE(test::count_of("fd"), files);
  EXPECT_LE(test::count_of("task"), threads);
}

TEST_F(GpuLossTest, PicturesContinueThroughAHundredLosses) {
  for (int i = 0; i < 100; i++) {
    RendererSelector gpu;
    std::string news;
    const std::shared_ptr<gl::GlesRenderer> drawer = gpu.open(RendererChoice::kGl, news);
    ASSERT_TRUE(drawer) << news;
    bool drawn = false;
    if (i % 10 == 0) {
      EXPECT_LE(render(drawer.get(), drawn), 1);
      EXPECT_TRUE(drawn);
    }
    drawer->lose();
    EXPECT_LE(render(gpu.open(RendererChoice::kGl, news).get(), drawn), 1);  // detected while rendering
    EXPECT_FALSE(drawn);
    EXPECT_EQ(news, "");
    EXPECT_EQ(gpu.open(RendererChoice::kGl, news), nullptr);
    EXPECT_MENTIONS(news, drawer->device(), "no longer", "CPU");
    EXPECT_MENTIONS(gpu.explain(RendererChoice::kGl), "cpu", drawer->device(), "lost");
    EXPECT_MENTIONS(gpu.explain(RendererChoice::kAuto), "auto: cpu", drawer->device(), "lost");
  }
}

}  // namespace
}  // namespace lf
