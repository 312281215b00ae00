// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Photo-consistency sums computed on the GPU, compared with the CPU's.

#include "composite/still.h"
#include "focus/hypothesis_renderer.h"
#include "focus/still_focus.h"
#include "focus/view_depths.h"
#include "lib/render/production.h"
#include "lib/render/sum_arrays.h"
#include "quality/image_quality.h"
#include "reference/generators.h"
#include "render/gl/gles_renderer.h"
#include "scene/scene.h"
#include "support/photographs.h"
#include "support/test.h"

namespace lf {
namespace {

using reference::Random;

gl::GlesRenderer& consistency_gpu() {
  static std::string why;
  static const auto drawer = gl::GlesRenderer::create(gl::Context::Drivers::kAny, why);
  if (!drawer) throw std::runtime_error("no OpenGL ES 3.1: " + why);
  return *drawer;
}

struct Both {
  std::vector<PhotoConsistency> cpu, gpu;
};

Both consistency_of(const RenderJob& job, std::span<const Source> sources,
                    std::span<const std::vector<uint8_t>> hypotheses) {
  Both both;
  for (std::vector<PhotoConsistency>* sums : {&both.cpu, &both.gpu}) {
    sums->resize(hypotheses.size());
    for (PhotoConsistency& sum : *sums) sum.reset(job.plan().view().width, job.plan().view().height);
  }
  add_consistency(job, sources, hypotheses, both.cpu);
  const GpuStatus drawing = add_consistency(job, sources, hypotheses, both.gpu, serial_for, &consistency_gpu());
  EXPECT_TRUE(drawing.drawn || sources.empty()) << drawing.why_not;
  return both;
}

struct MomentDifference {
  size_t nodes = 0;
  size_t otherwise = 0;  // nodes with a different set of cameras
  int weight = 0;        // weight error of the remaining nodes, of 32768
  double luma = 0;       // levels, at nodes of full weight: mean, and root mean square
  double square = 0;

  void add(const Both& both) {
    for (size_t t = 0; t < both.cpu.size(); t++)
      for (size_t i = 0; i < both.cpu[t].weight.size(); i++) {
        const int w = both.cpu[t].weight[i], off = std::abs(w - both.gpu[t].weight[i]);
        nodes++;
        if (off > 8) {
          otherwise++;
          continue;
        }
        weight = std::max(weight, off);
        if (w < 32000) continue;
        const auto mean = [&](const PhotoConsistency& m) { return m.luma[i] / double{PhotoConsistency::kLumaOne}; };
        luma = std::max(luma, std::abs(mean(both.cpu[t]) - mean(both.gpu[t])));
        const auto spread = [&](const PhotoConsistency& m) { return std::sqrt(m.square[i] * 1.); };
        square = std::max(square, std::abs(spread(both.cpu[t]) - spread(both.gpu[t])));
      }
  }
};

Image chequered_blocks(Random&, int width, int height) {
  Image image(PixelFamily::kRgb, width, height);
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++)
      for (int c = 0; c < 3; c++) image.pixel(x, y)[c] = (x / 3 + y / 5) % 2 ? 255 : 0;
  return image;
}

std::vector<std::vector<uint8_t>> some_hypotheses(Random& random, const View& view) {
  const std::vector<std::vector<uint8_t>> hypotheses =
      hypothesis_levels(view, hypotheses_of_round(random.integer(0, 20)));
  return hypotheses;
}

// Views of an array with distorted lenses, rotated, from coarse to fine: boxes of 4 to 32 pixels.
TEST(GpuConsistency, MatchesTheCpu) {
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420})
    for (const bool hard : {false, true}) {
      MomentDifference worst;
      int largest_box = 0;
      for (int trial = 0; trial < 8; trial++) {
        Random random(trial);
        const int side = 3 + trial % 3, width = trial % 2 ? 157 : 320, height = trial % 2 ? 121 : 240;
        const Rig rig = test::jittered_array(random, side, width, height, trial % 3 == 0 ? 0 : -0.25);
        View view = test::view_into(side, width >> (trial / 2), height >> (trial / 2), random.small_rotation(0.2));
        view.blending.extrapolates = false;  // GPUs only draw hypotheses inside the mesh
        if (trial == 5)
          view.lens = Lens(LensModel::kSimpleRadial, {1.25 * view.width, view.width / 2., view.height / 2., -0.1});
        view.focus.map = test::depths(random, view, FocalMap::kMinStep, false);
        const Mesh mesh = build_mesh(rig);
        std::vector<CameraIndex> own;
        for (CameraIndex i = 0; i < rig.cameras.size(); i++)
          if (trial != 2 || i % 2 == 0) own.push_back(i);  // the rest belong to another node
        const RenderJob job(rig, mesh, hypothesis_view(view), own);
        const auto rgb = images_of(rig, random, hard ? chequered_blocks : reference::smooth_image);
        const std::vector<Image> images = family == PixelFamily::kI420 ? test::i420_of(rgb) : rgb;
        std::vector<Source> sources;
        for (const CameraIndex i : job.cameras()) {
          sources.push_back({i, &rig.cameras[i], images[i].view()});
          if (trial == 3 && i % 3 == 0) sources.back().image = {.family = PixelFamily::kNone};
          largest_box = std::max(largest_box, hypothesis_box(job.plan(), i, rig.cameras[i]));
        }
        const std::vector<std::vector<uint8_t>> hypotheses = some_hypotheses(random, view);
        worst.add(consistency_of(job, sources, hypotheses));
      }
      std::printf("%s %-12s: weight %d, mean luma %.3f, its root mean square %.3f, other cameras in %zu of %zu nodes\n",
                  family == PixelFamily::kI420 ? "I420" : "RGB ", hard ? "checkerboard" : "smooth", worst.weight,
                  worst.luma, worst.square, worst.otherwise, worst.nodes);
      EXPECT_EQ(largest_box, kMaxHypothesisBox);
      EXPECT_LE(worst.weight, 3);
      EXPECT_LE(worst.luma, 1.1);
      EXPECT_LE(worst.square, 1.6);
      EXPECT_LE(worst.otherwise, worst.nodes / 1000);
    }
}

struct SmallArray {
  explicit SmallArray(double k1) : rig(test::jittered_array(random, 3, 160, 120, k1)) {
    View view = test::view_into(3, 160, 120, random.small_rotation(0.2));
    view.blending.extrapolates = false;  // GPUs only draw hypotheses inside the mesh
    view.focus.map = test::depths(random, view, FocalMap::kMinStep, false);
    hypotheses = some_hypotheses(random, view);
    job.emplace(rig, build_mesh(rig), hypothesis_view(view), test::all_cameras(rig));
    images = images_of(rig, random, reference::smooth_image);
    for (const CameraIndex i : job->cameras()) sources.push_back({i, &rig.cameras[i], images[i].view()});
  }
  std::vector<PhotoConsistency> nothing() const {
    std::vector<PhotoConsistency> sums(hypotheses.size());
    for (PhotoConsistency& sum : sums) sum.reset(job->plan().view().width, job->plan().view().height);
    return sums;
  }
  Random random{1};
  Rig rig;
  std::optional<RenderJob> job;
  std::vector<Image> images;
  std::vector<Source> sources;
  std::vector<std::vector<uint8_t>> hypotheses;
};

TEST(GpuConsistency, SumsAreAdded) {
  const SmallArray array(0);
  const Both once = consistency_of(*array.job, array.sources, array.hypotheses);
  std::vector<PhotoConsistency> thrice = array.nothing();
  for (int i = 0; i < 3; i++)
    EXPECT_TRUE(
        add_consistency(*array.job, array.sources, array.hypotheses, thrice, serial_for, &consistency_gpu()).drawn);
  bool any = false;
  for (size_t t = 0; t < thrice.size(); t++)
    for (size_t i = 0; i < thrice[t].weight.size(); i++) {
      EXPECT_EQ(thrice[t].weight[i], std::min(3 * once.gpu[t].weight[i], 65535));
      any = any || thrice[t].weight[i] == 65535;
    }
  EXPECT_TRUE(any);
}

// The GPU preserves the relation between one camera's sums: see wire/consistency_codec.h.
TEST(GpuConsistency, SumsOfOneCameraAreConsistent) {
  const SmallArray array(-0.2);
  const Both both = consistency_of(*array.job, {&array.sources[4], 1}, array.hypotheses);
  size_t seen = 0;
  for (const PhotoConsistency& sum : both.gpu)
    for (size_t i = 0; i < sum.weight.size(); i++) {
      if (sum.weight[i] == 0) {
        EXPECT_EQ(sum.luma[i] | sum.square[i], 0);
        continue;
      }
      seen++;
      bool follows = false;
      for (int value = 0; value <= 255 && !follows; value++) {
        const uint16_t luma = PhotoConsistency::luma_of(sum.weight[i], value);
        follows = luma == sum.luma[i] && PhotoConsistency::square_of(luma, value) == sum.square[i];
      }
      EXPECT_TRUE(follows) << i;
    }
  EXPECT_GT(seen, 1000u);
}

// Arrays and surfaces that are worst cases for float: equal except at nodes where float cannot determine which camera
// sees the node.
TEST(GpuConsistency, HardCasesAreFiniteAndMostlyMatchTheCpu) {
  MomentDifference all;
  for (const reference::HardCase& hard : reference::hard_cases())
    for (int trial = 0; trial < 2; trial++) {
      Random random(trial);
      auto [rig, view] = hard.make(random);
      if (view.width < 8 || view.height < 8) continue;
      view.focus.map = test::depths(random, view, FocalMap::kMinStep, trial == 1);
      const Mesh mesh = build_mesh(rig);
      const RenderJob job(rig, mesh, hypothesis_view(view), test::all_cameras(rig));
      const auto images = images_of(rig, random, reference::smooth_image);
      std::vector<Source> sources;
      for (const CameraIndex i : job.cameras()) sources.push_back({i, &rig.cameras[i], images[i].view()});
      if (sources.empty()) continue;
      MomentDifference one;
      one.add(consistency_of(job, sources, some_hypotheses(random, view)));
      SCOPED_TRACE(hard.name);
      std::printf("%-40s: weight %d, mean luma %.3f, other cameras in %zu of %zu nodes\n", hard.name, one.weight,
                  one.luma, one.otherwise, one.nodes);
      EXPECT_LE(one.weight, 8);
      EXPECT_LE(one.luma, 1.2);
      EXPECT_LE(one.otherwise, one.nodes / 100);
      all.nodes += one.nodes;
    }
  EXPECT_GT(all.nodes, 10000u);
}

TEST(GpuConsistency, FindsTheSameSurface) {
  const Rig rig = scene_rig(4, 4, 160, 120);
  const Mesh mesh = build_mesh(rig);
  const CameraSet own = test::all_cameras(rig);
  const std::vector<Image> images = test::scene_images(rig, 0.5, 2);
  const FocusArray array(rig);
  double sum = 0;
  constexpr int kViews = 4;
  for (int n = 0; n < kViews; n++) {
    View view{.width = 160, .height = 120, .lens = rig.cameras[0].lens, .pose = {}, .focus = {}};
    view.blending.extrapolates = false;  // GPUs only draw hypotheses inside the mesh
    view.pose.position = {0.013 * n - 0.022, 0.011 * n - 0.013, 0.01 * n};
    view.focus.plane = focal_plane_at(view.pose, 2.6);
    const Image truth = render_scene({view.width, view.height, view.lens, view.pose}, 0.5);
    const auto quality = [&](const View& shown) {
      const Still still = render_still(rig, mesh, shown, [&](CameraIndex i) -> const Image& { return images[i]; });
      return compare(still.picture, truth, still.coverage).psnr_db;
    };
    double with[2];
    for (const bool by_gpu : {false, true}) {
      ViewDepths focus({.mode = FocusMode::kSurface});
      ViewRequest request;
      for (int round = 0; round <= kSettledRounds; round++) {
        request = {.view = view};
        request.sequence = static_cast<uint32_t>(round);
        focus.apply(request);
        ViewDepths::Answers answers;
        if (!request.hypotheses.empty()) {
          const std::vector<std::vector<uint8_t>> levels = hypothesis_levels(request.view, request.hypotheses);
          answers.moments.resize(levels.size());
          for (PhotoConsistency& of : answers.moments)
            of.reset(request.view.focus.map->columns, request.view.focus.map->rows);
          const RenderJob job(rig, mesh, hypothesis_view(request.view), own);
          std::vector<Source> sources;
          for (const CameraIndex i : job.cameras()) sources.push_back({i, &rig.cameras[i], images[i].view()});
          const GpuStatus drawing =
              add_consistency(job, sources, levels, answers.moments, serial_for, by_gpu ? &consistency_gpu() : nullptr);
          EXPECT_EQ(drawing.drawn, by_gpu) << drawing.why_not;
        }
        focus.take(request, answers, array);
      }
      with[by_gpu] = quality(displayed_view(request));
    }
    const double plane = quality(view);
    std::printf("view %d: %.2f dB on the plane, %.3f with the CPU's moments, %.3f with the GPU's\n", n, plane, with[0],
                with[1]);
    EXPECT_NEAR(with[0], with[1], 0.05);
    EXPECT_GT(with[1], plane + 1.5);
    sum += with[1] - with[0];
  }
  EXPECT_LE(std::abs(sum / kViews), 0.02);
}

TEST(GpuConsistency, FallsBackToTheCpu) {
  std::string why;
  const auto lost = gl::GlesRenderer::create(gl::Context::Drivers::kAny, why);
  ASSERT_TRUE(lost) << why;
  lost->lose();
  const SmallArray array(0);
  std::vector<PhotoConsistency> cpu = array.nothing(), of_lost = cpu;
  add_consistency(*array.job, array.sources, array.hypotheses, cpu);
  const GpuStatus refused =
      add_consistency(*array.job, array.sources, array.hypotheses, of_lost, serial_for, lost.get());
  EXPECT_TRUE(refused.refused);
  EXPECT_MENTIONS(refused.why_not, "context", "lost");
  for (size_t t = 0; t < cpu.size(); t++) {
    EXPECT_EQ(of_lost[t].weight, cpu[t].weight);
    EXPECT_EQ(of_lost[t].luma, cpu[t].luma);
    EXPECT_EQ(of_lost[t].square, cpu[t].square);
  }
}

}  // namespace
}  // namespace lf
