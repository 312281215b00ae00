// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/gles_renderer.h"
#include "lib/render/production.h"
#include "lib/render/sum_arrays.h"
#include "reference/generators.h"
#include "render/sum_renderer.h"
#include "support/rigs.h"
#include "support/test.h"

namespace lf {
namespace {

using reference::Random;
using test::Eye, test::Sum;

struct Difference : test::SumDifference {
  size_t fixed_up = 0;
  void add(const Difference& other) {
    SumDifference::add(other);
    fixed_up += other.fixed_up;
  }
};

void expect_at_most(const test::SumDifference& difference, double level) {
  EXPECT_LE(difference.level, level);
  EXPECT_LE(difference.lost, 1e-4);
}

gl::GlesRenderer& shared_gpu() {
  static const std::unique_ptr<gl::GlesRenderer> gpu = test::new_gpu();
  return *gpu;
}

class GlesRenderer : public testing::Test {
 protected:
  gl::GlesRenderer& gpu() const { return shared_gpu(); }
  // Returns the difference between the sums of GPU and CPU. `change` edits the sources.
  Difference difference(const Rig& rig, const View& view, const std::vector<Image>& rgb, PixelFamily family,
                        const std::function<void(std::vector<Source>&)>& change = {}) const;
};

Difference GlesRenderer::difference(const Rig& rig, const View& view, const std::vector<Image>& rgb, PixelFamily family,
                                    const std::function<void(std::vector<Source>&)>& change) const {
  const std::vector<Image> images = test::in_family(family, rgb);
  Eye eye(rig, build_mesh(rig), view, images, family);
  if (change) change(eye.sources);
  const auto cpu = eye.renderer(), drawn = eye.renderer(&gpu());
  EXPECT_TRUE(drawn->drawing().drawn || drawn->rect().empty()) << drawn->drawing().why_not;
  const Rect whole = test::whole(view);
  Sum a(family, whole), b(family, whole);
  const auto has_missing = [](const Sum& sum) {
    return std::any_of(sum.lost.begin(), sum.lost.end(), [](auto weight) { return weight != 0; });
  };
  // The CPU may report missing weight too if it rounds to zero.
  const bool cpu_says_lost = cpu->render_rows(0, view.height, a.planes);
  const bool gpu_says_lost = drawn->render_rows(0, view.height, b.planes);
  EXPECT_EQ(gpu_says_lost, has_missing(b));
  EXPECT_GE(cpu_says_lost, has_missing(a));
  EXPECT_GE(cpu_says_lost, has_missing(b));
  return {test::difference_of(a, b), gpu().fixed_up()};
}

TEST_F(GlesRenderer, MatchesTheCpu) {
  std::printf("%s\n", gpu().device().c_str());
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420})
    for (const bool map : {false, true})
      for (const bool hard : {false, true}) {
        Difference worst;
        for (int trial = 0; trial < 4; trial++) {
          Random random(trial);
          const auto [rig, view] = test::array_and_view(trial, random, map);
          const auto images = images_of(rig, random, hard ? test::checkerboard : reference::smooth_image);
          worst.add(difference(rig, view, images, family));
        }
        std::printf("%-4s %s %-12s: levels %.3f, lost %.2g, %zu fixed up\n", test::name_of(family),
                    map ? "map  " : "plane", hard ? "checkerboard" : "smooth", worst.level, worst.lost, worst.fixed_up);
        expect_at_most(worst, hard ? 0.75 : 0.2);
      }
}

TEST_F(GlesRenderer, TheCpuRendersSumsWithMasks) {
  Random random(3);
  const auto [rig, view] = test::array_and_view(0, random, true);
  const auto images = test::in_family(PixelFamily::kRgb, images_of(rig, random, reference::smooth_image));
  Eye eye(rig, build_mesh(rig), view, images, PixelFamily::kRgb);
  const FocalMap& map = *view.focus.map;
  ASSERT_EQ(map.step, FocalMap::kMinStep);
  VisibilityMask mask{map.columns, map.rows, std::vector<uint8_t>(map.levels.size(), VisibilityMask::kHidden)};
  const auto unmasked = eye.renderer();
  eye.sources[0].visibility = &mask;
  const auto cpu = eye.renderer(), masked = eye.renderer();
  SumRenderer* const both[] = {unmasked.get(), masked.get()};
  SumRenderer::draw(both, gpu(), serial_for);
  EXPECT_TRUE(unmasked->drawing().drawn) << unmasked->drawing().why_not;
  EXPECT_FALSE(masked->drawing().drawn);
  EXPECT_FALSE(masked->drawing().refused) << "the GPU may render other sums";
  EXPECT_THAT(masked->drawing().why_not, mentions("hides"));
  const Rect whole = test::whole(view);
  Sum a(PixelFamily::kRgb, whole), b(PixelFamily::kRgb, whole);
  EXPECT_TRUE(cpu->render_rows(0, view.height, a.planes));
  EXPECT_TRUE(masked->render_rows(0, view.height, b.planes));
  const test::SumDifference difference = test::difference_of(a, b);
  EXPECT_EQ(difference.level, 0);
  EXPECT_EQ(difference.lost, 0);
}

// Views a few pixels wide, with pixels as wide as faces, exercise incomplete blocks. Other views see camera pixels
// enlarged or reduced. `LF_SCALES` sets the number of views.
TEST_F(GlesRenderer, DrawsTinyViewsAndAllScales) {
  Difference worst;
  for (int n = 0; n < test::number_of_views(150); n++) {
    SCOPED_TRACE("view " + std::to_string(n));
    Random random(n);
    const Rig rig = test::jittered_array(random, 4, 160, 120, n % 3 ? 0 : -0.25);
    const bool tiny = n % 2;
    View view = test::view_into(4, tiny ? random.integer(1, 9) : random.integer(30, 120),
                                tiny ? random.integer(1, 7) : random.integer(20, 90), random.small_rotation(0.1));
    const double focal =
        tiny ? random.uniform(0.8, 2.5) * view.width : 1.25 * 160 / std::exp2(random.uniform(-2.5, 2.5));
    view.lens = Lens::pinhole(focal, (view.width - 1) / 2.0, (view.height - 1) / 2.0);
    if (n % 5 == 0) view.focus.map = test::depths(random, view, FocalMap::kMinStep, n % 10 == 0);
    view.pose.position.z = random.uniform(-0.2, 0.05);
    const auto images = images_of(rig, random, reference::smooth_image);
    const PixelFamily family = n % 4 ? PixelFamily::kI420 : PixelFamily::kRgb;
    const Difference one = difference(rig, view, images, family);
    expect_at_most(one, 0.2);
    worst.add(one);
  }
  std::printf("levels %.3f, %zu fixed up\n", worst.level, worst.fixed_up);
}

// Planes and surfaces through viewpoints, arrays behind them, folded meshes, slivers: cases that the CPU decides per
// face and cases left to the GPU's doubt mask.
TEST_F(GlesRenderer, RendersHardCases) {
  for (const reference::HardCase& small : reference::hard_cases())
    for (const reference::HardCase& hard : {small, reference::enlarged(small, reference::kEnlarged)}) {
      Difference worst;
      for (int trial = 0; trial < 2; trial++) {
        Random random(trial);
        const auto [rig, view] = hard.make(random);
        worst.add(difference(rig, view, images_of(rig, random, reference::smooth_image), PixelFamily::kI420));
      }
      SCOPED_TRACE(hard.name);
      expect_at_most(worst, 0.2);
    }
}

TEST_F(GlesRenderer, EveryLensMatchesTheCpu) {
  const std::vector<Lens> lenses = test::lenses_beyond_opencv(320, 240);
  for (size_t i = 0; i < lenses.size(); i++)
    for (const bool mapped : {false, true}) {
      Random random(static_cast<uint32_t>(i));
      auto [rig, view] = test::array_with_lens(lenses[i], random, mapped);
      rig.cameras[2].lens = Lens(LensModel::kRadial, {320, 159.5, 119.5, -0.2, 0.04});  // in the same shader
      rig.cameras[3].lens = Lens::pinhole(320, 159.5, 119.5);
      if (i % 3 == 2) {
        view.lens = lenses[i];
        view.pose.position.z = -0.05;
      }
      SCOPED_TRACE(testing::Message() << lens_model_name(lenses[i].model()) << (mapped ? " map" : " plane"));
      const auto images = images_of(rig, random, reference::smooth_image);
      const Difference one = difference(rig, view, images, i % 2 ? PixelFamily::kRgb : PixelFamily::kI420);
      std::printf("%s: levels %.3f, lost %.2g, %zu fixed up\n", std::string(lens_model_name(lenses[i].model())).c_str(),
                  one.level, one.lost, one.fixed_up);
      expect_at_most(one, 0.2);
      EXPECT_LT(one.fixed_up, 320u * 240 / 4) << "float decides most samples";
    }
}

TEST_F(GlesRenderer, AcceptsAnySources) {
  constexpr int kSide = 4, kWidth = 161, kHeight = 121;
  Random random(5);
  const Rig rig = test::jittered_array(random, kSide, kWidth, kHeight, -0.2);
  const auto images = images_of(rig, random, reference::smooth_image);
  std::vector<Image> bgrx;
  for (const Image& image : images) {
    Image& made = bgrx.emplace_back(PixelFamily::kRgb, 4 * kWidth, kHeight);
    for (int y = 0; y < kHeight; y++)
      for (int x = 0; x < kWidth; x++)
        for (int c = 0; c < 3; c++) made.data()[(size_t(y) * 4 * kWidth * 3) + 4 * x + 2 - c] = image.pixel(x, y)[c];
  }
  const auto others = [](std::vector<Source>& sources) {
    std::erase_if(sources, [](const Source& source) { return source.camera % 2 == 0; });
  };
  const auto blind = [](std::vector<Source>& sources) {
    for (Source& source : sources)
      if (source.camera % 3 == 0) source.image = {.family = PixelFamily::kNone};
  };
  const auto mixed_layouts = [&](std::vector<Source>& sources) {
    for (Source& source : sources) {
      if (source.image.family != PixelFamily::kRgb || source.camera % 2 == 0) continue;
      source.image.plane[0] = bgrx[source.camera].data().data();
      source.image.stride[0] = 3 * 4 * kWidth;
      source.image.layout = {4, 2, 1, 0};
    }
  };
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420})
    for (const bool lens : {false, true})
      for (const bool map : {false, true}) {
        View view = test::view_into(kSide, kWidth, kHeight, random.small_rotation(0.2));
        if (lens) view.lens = Lens(LensModel::kSimpleRadial, {1.25 * kWidth, 78, 60, -0.1});
        if (map) view.focus.map = test::depths(random, view, FocalMap::kMinStep, false);
        int number = 0;
        for (const auto& change : {std::function<void(std::vector<Source>&)>{}, {others}, {blind}, {mixed_layouts}}) {
          SCOPED_TRACE(testing::Message() << test::name_of(family) << (lens ? ", lens" : "") << (map ? ", map" : "")
                                          << ", sources " << number++);
          expect_at_most(difference(rig, view, images, family, change), 0.2);
        }
      }
}

// Samples exactly on the image border: (-0.5, y) is inside, but float precision cannot decide this.
TEST_F(GlesRenderer, LeavesUndecidedSamplesToTheCpu) {
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420}) {
    Random random(1);
    const Rig rig = test::camera_grid(2, 2, 0.1, 160, 120, 200);
    View view;
    view.width = 200;
    view.height = 140;
    view.pose = rig.cameras[0].pose;
    view.lens = Lens::pinhole(200, 79.5 + 10.5, 59.5);
    view.focus.plane = plane_through({0, 0, 2}, {0, 0, -1});
    const Difference one = difference(rig, view, images_of(rig, random, reference::smooth_image), family);
    expect_at_most(one, 0.2);
    EXPECT_GE(one.fixed_up, 100u);
  }
}

TEST_F(GlesRenderer, CpuContinuesAfterALoss) {
  const auto gpu = test::new_gpu();
  Random random(2);
  const Rig rig = test::jittered_array(random, 3, 160, 120, -0.25);
  const View view = test::view_into(3, 160, 120, random.small_rotation(0.2));
  const auto images = images_of(rig, random, reference::smooth_image);
  const Eye eye(rig, build_mesh(rig), view, images, PixelFamily::kRgb);
  const auto before = eye.renderer(gpu.get());
  EXPECT_TRUE(before->drawing().drawn);
  const Sum sum = eye.sum_of(*before);
  gpu->lose();
  const auto after = eye.renderer(gpu.get());
  EXPECT_FALSE(after->drawing().drawn);
  EXPECT_TRUE(gpu->is_lost());
  EXPECT_LE(test::difference_of(sum, eye.sum_of(*after)).level, 0.2);
  EXPECT_FALSE(eye.renderer(gpu.get())->drawing().drawn);
}

// A thread that copies images for one sum may be assigned another sum meanwhile (FairScheduler).
TEST_F(GlesRenderer, RendersWhileImagesAreCopied) {
  Random random(3);
  const Rig rig = test::jittered_array(random, 3, 160, 120, 0);
  const Mesh mesh = build_mesh(rig);
  const auto images = images_of(rig, random, reference::smooth_image);
  const View left = test::view_into(3, 160, 120, random.small_rotation(0.2)),
             right = test::view_into(3, 200, 90, random.small_rotation(0.2));
  const test::Production of_left(rig, mesh, left), of_right(rig, mesh, right);
  const auto render = [&](const test::Production& production, const View& view, const ParallelFor& parallel) {
    const std::vector<Source> sources = test::sources_of(rig, production.plan, images);
    const SumRenderer renderer(production.plan, production.owners.runs(), sources, PixelFamily::kRgb,
                               Coordinates::kExact, &gpu(), parallel);
    EXPECT_TRUE(renderer.drawing().drawn) << renderer.drawing().why_not;
    Sum sum(PixelFamily::kRgb, test::whole(view));
    renderer.render_rows(0, view.height, sum.planes);
    return sum;
  };
  const Sum left_alone = render(of_left, left, serial_for), right_alone = render(of_right, right, serial_for);
  for (int depth = 1; depth <= 3; depth++) {
    int level = 0;
    std::vector<Sum> between;
    const ParallelFor nesting = [&](size_t count, const std::function<void(size_t)>& task) {
      for (size_t i = 0; i < count; i++) {
        task(i);
        if (i == count / 2 && level++ < depth) between.push_back(render(of_right, right, nesting));
      }
    };
    const Sum sum = render(of_left, left, nesting);
    EXPECT_EQ(between.size(), static_cast<size_t>(depth));
    EXPECT_TRUE(sum == left_alone);
    for (const Sum& other : between) EXPECT_TRUE(other == right_alone);
  }
}

TEST_F(GlesRenderer, MayBeLostBeforeTheFirstDraw) {
  const auto gpu = test::new_gpu();
  gpu->lose();
  Random random(4);
  const Rig rig = test::jittered_array(random, 3, 160, 120, 0);
  const View view = test::view_into(3, 160, 120, random.small_rotation(0.2));
  const auto images = images_of(rig, random, reference::smooth_image);
  const auto renderer = Eye(rig, build_mesh(rig), view, images, PixelFamily::kRgb).renderer(gpu.get());
  EXPECT_TRUE(renderer->drawing().refused);
  EXPECT_MENTIONS(renderer->drawing().why_not, "context", "lost");
  EXPECT_TRUE(gpu->is_lost());
}

// Larger than the storage buffers that OpenGL ES 3.1 guarantees.
TEST(GlesRendererLimits, LargerSumsUseTheCpu) {
  gl::GlesRenderer& gpu = shared_gpu();
  Random random(6);
  const Rig rig = test::jittered_array(random, 2, 160, 120, 0);
  View view = test::view_into(2, 160, 120, random.small_rotation(0.2));
  view.width = view.height = 15000;
  view.lens = Lens::pinhole(200 * 100, 7500, 7500);
  const ViewPlan plan(rig, build_mesh(rig), view);
  const FaceRuns runs(plan, {0, 0, view.width, view.height});
  const auto images = images_of(rig, random, reference::smooth_image);
  const std::vector<Source> sources = test::sources_of(rig, plan, images);
  const SumRenderer renderer(plan, runs, sources, PixelFamily::kRgb, Coordinates::kExact, &gpu);
  EXPECT_TRUE(renderer.drawing().refused);
  EXPECT_MENTIONS(renderer.drawing().why_not, "view", "large");
  EXPECT_FALSE(gpu.is_lost());
}

TEST(GlesRendererCreation, HardwareExcludesSoftwareRenderers) {
  std::string why;
  const auto drawer = gl::GlesRenderer::create(gl::Context::Drivers::kHardware, why);
  if (drawer)
    EXPECT_FALSE(drawer->is_software()) << drawer->device();
  else
    EXPECT_NE(why, "");
}

// A renderer without uploaded images renders a view that no camera sees.
TEST_F(GlesRenderer, StartsWithBlindCameras) {
  const auto fresh = test::new_gpu();
  Random random(7);
  const Rig rig = test::jittered_array(random, 3, 64, 48, 0);
  const View view = test::view_into(3, 64, 48, {1, 0, 0, 0});
  const std::vector<Image> images = images_of(rig, random, reference::smooth_image);
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420}) {
    Eye eye(rig, build_mesh(rig), view, images, family);
    for (Source& source : eye.sources) source.image = {.family = PixelFamily::kNone};
    const auto renderer = eye.renderer(fresh.get());
    ASSERT_TRUE(renderer->drawing().drawn) << renderer->drawing().why_not;
    Sum sum(family, test::whole(view));
    EXPECT_TRUE(renderer->render_rows(0, view.height, sum.planes));
    EXPECT_EQ(sum.missing_weight(32, 24), 1);
  }
}

Blending within(double aperture) { return {.kind = Blending::Kind::kAperture, .aperture = aperture}; }
Blending nearest(int count) { return {.kind = Blending::Kind::kAngle, .nearest = count}; }

// Views with more than three cameras per pixel, rendered by compute shaders.
class GlesRendererBlending : public testing::Test {
 protected:
  Difference difference(const Eye& eye) {
    const auto cpu = eye.renderer(nullptr), drawn = eye.renderer(gpu_.get());
    EXPECT_TRUE(drawn->drawing().drawn || drawn->rect().empty()) << drawn->drawing().why_not;
    return {test::difference_of(eye.sum_of(*cpu), eye.sum_of(*drawn)), gpu_->fixed_up()};
  }
  static std::vector<Image> images_of_family(const Rig& rig, Random& random, PixelFamily family) {
    return test::in_family(family, images_of(rig, random, reference::smooth_image));
  }

  const std::unique_ptr<gl::GlesRenderer> gpu_ = test::new_gpu();
};

// Apertures from less than the pitch to the whole array, and 1 to 8 nearest cameras; planes and maps, distorted lenses,
// borders, rotated views, nodes with some of the cameras, missing images.
TEST_F(GlesRendererBlending, MatchTheCpu) {
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420}) {
    Difference worst;
    for (int seed = 0; seed < 20; seed++) {
      SCOPED_TRACE(seed);
      Random random(seed);
      const Rig rig = test::jittered_array(random, 4, 161, 120, seed % 3 ? -0.25 : 0);
      View view = test::view_into(4, 150 + seed % 5, 111, random.small_rotation(seed % 4 == 2 ? 0.5 : 0.1));
      view.blending = seed % 2 ? within(random.uniform(0.02, 0.5)) : nearest(random.integer(1, 8));
      if (seed % 4 == 3) {  // partly beside the mesh
        view.blending = {};
        view.pose.position.x += random.uniform(0.05, 0.2);
      }
      if (seed % 5 < 2) view.focus.map = test::depths(random, view, 8, seed % 5 == 1);
      if (seed % 7 == 3) view.lens = Lens(LensModel::kSimpleRadial, {1.25 * view.width, 70, 50, -0.1});
      const std::vector<Image> images = images_of_family(rig, random, family);
      Eye eye(rig, build_mesh(rig), view, images, family);
      if (seed % 6 == 5) std::erase_if(eye.sources, [](const Source& source) { return source.camera % 3 == 0; });
      for (Source& source : eye.sources)
        if (seed % 3 == 1 && source.camera % 5 == 2) source.image = {.family = PixelFamily::kNone};
      worst.add(difference(eye));
    }
    std::printf("%s: levels %.3f, lost %.2g, %zu fixed up\n", test::name_of(family), worst.level, worst.lost,
                worst.fixed_up);
    EXPECT_LE(worst.level, 0.1);
    EXPECT_LE(worst.lost, 1.01 / kMissingOne) << "the CPU does not sum the total weight";
  }
}

// Nodes with sums at odd offsets, and with more cameras than a grid point has.
TEST_F(GlesRendererBlending, NodesWithSomeCamerasMatchTheCpu) {
  int odd = 0;
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420}) {
    Random random(3);
    const Rig rig = test::jittered_array(random, 9, 97, 72, -0.2);
    View view = test::view_into(9, 150, 111, random.small_rotation(0.1));
    const std::vector<Image> images = images_of_family(rig, random, family);
    for (const Blending& blending : {within(0.2), within(1.3), nearest(6)}) {
      view.blending = blending;
      const Eye all(rig, build_mesh(rig), view, images, family);
      Difference worst = difference(all);
      for (int node = 0; node < 9; node++) {
        Eye eye = all;
        std::erase_if(eye.sources, [&](const Source& of) {
          return static_cast<int>(of.camera % 9) / 3 != node % 3 || static_cast<int>(of.camera / 27) != node / 3;
        });
        const Rect rect = eye.renderer(nullptr)->rect();
        odd += rect.x0 % 2 && rect.y0 % 2;
        worst.add(difference(eye));
      }
      EXPECT_LE(worst.level, 0.2);
      EXPECT_LE(worst.lost, 1.01 / kMissingOne);
    }
  }
  EXPECT_GT(odd, 0);
}

// The viewpoint at a camera, in the array's plane, and behind the array; a single camera; coincident cameras; a view
// from a camera's pose, with borders that float cannot decide.
TEST_F(GlesRendererBlending, HardCasesMatchTheCpu) {
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420})
    for (const Blending& blending : {within(0.25), nearest(4)}) {
      Difference worst;
      for (int hard = 0; hard < 6; hard++) {
        SCOPED_TRACE(hard);
        Random random(hard);
        Rig rig = test::jittered_array(random, 3, 161, 120, hard == 5 ? 0 : -0.2);
        View view = test::view_into(3, 201, 161, random.small_rotation(0.05));
        const Camera& middle = rig.cameras[4];
        if (hard == 0) view.pose.position = middle.pose.position;
        if (hard == 1) view.pose.position = {0.12, 0.07, 1e-12};
        if (hard == 2) view.pose.position.z = 0.4;
        if (hard == 3) rig.cameras[5].pose.position = rig.cameras[3].pose.position = middle.pose.position;
        if (hard == 5) {
          view.pose = middle.pose;
          view.lens = Lens::pinhole(middle.lens.fx(), middle.lens.cx() + 20.5, middle.lens.cy() + 20.5);
        }
        view.blending = blending;
        const std::vector<Image> images = images_of_family(rig, random, family);
        Eye eye(rig, build_mesh(rig), view, images, family);
        if (hard == 4) eye.sources.resize(1);
        worst.add(difference(eye));
      }
      EXPECT_LE(worst.level, 0.1);
      EXPECT_LE(worst.lost, 1.01 / kMissingOne);
      EXPECT_GT(worst.fixed_up, 100u);
    }
}

}  // namespace
}  // namespace lf
