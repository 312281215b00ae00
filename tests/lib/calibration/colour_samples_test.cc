// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/colour_samples.h"
#include "calibration/colour_solve.h"
#include "image/colour_correction.h"
#include "scene/calibration_targets.h"
#include "scene/scene.h"
#include "support/expect_error.h"
#include "support/photographs.h"
#include "support/test.h"

namespace lf {
namespace {

// The order of the patches is checked by their centres in the image.
TEST(ColourCheckerFinder, FindsEveryPatchAtItsPosition) {
  const Rig rig = scene_rig(3, 3, 640, 480);
  size_t found = 0;
  for (const ChartPose& chart : colour_chart_poses(rig, 4))
    for (const size_t i : {0u, 4u, 8u}) {
      const Camera& camera = rig.cameras[i];
      const Image image = render_chart({camera.width, camera.height, camera.lens, camera.pose}, chart);
      const std::vector<ColourSample> samples = find_colour_checker(image, static_cast<CameraIndex>(i), 48);
      found += !samples.empty();
      for (const ColourSample& sample : samples) {
        EXPECT_EQ(sample.camera, i);
        ASSERT_GE(sample.patch, 48u);
        ASSERT_LT(sample.patch, 72u);
        const Vec2 at =
            (checker::middle(static_cast<int>(sample.patch) - 48) - Vec2(checker::kWidth, checker::kHeight) / 2.0) *
            (chart.width / checker::kWidth);
        const auto pixel =
            camera.lens.project(camera.pose.camera_from_world(chart.world_from_chart.world_from_camera(Vec3(at, 0))))
                .value();
        EXPECT_LE(glm::length(pixel - sample.place), 6) << "patch " << sample.patch - 48;
      }
    }
  EXPECT_GE(found, 9u) << "of 12";
}

TEST(ColourCheckerFinder, FindsChartsInNoiseAndSmallImages) {
  const Rig rig = scene_rig(1, 1, 320, 240);
  const Camera& camera = rig.cameras[0];
  const ChartPose chart = colour_chart_poses(rig, 1)[0];
  const Image image = render_chart({camera.width, camera.height, camera.lens, camera.pose}, chart);
  ColourFault fault = random_faults(1, 1)[0];
  const std::vector<ColourSample> samples =
      find_colour_checker(apply_fault(image, fault, camera.principal_point(), 1), 0, 0);
  ASSERT_EQ(samples.size(), 24u);
  for (size_t i = 19; i < 24; i++) EXPECT_LT(samples[i].level.y + 10, samples[i - 1].level.y) << "greys get darker";
}

TEST(ColourCheckerFinder, ReturnsNothingWithoutAChart) {
  EXPECT_TRUE(find_colour_checker(Image(PixelFamily::kRgb, 320, 240), 0, 0).empty());
  const Rig rig = scene_rig(1, 1, 320, 240);
  const Camera& camera = rig.cameras[0];
  EXPECT_TRUE(find_colour_checker(render_scene({320, 240, camera.lens, camera.pose}, 0), 0, 0).empty());
}

TEST(ColourCheckerFinder, MisreadChartsAreRemoved) {
  const auto chart = [](uint32_t number, double beside) {
    std::vector<ColourSample> samples;
    for (int patch = 0; patch < checker::kPatches; patch++) {
      ColourSample& sample = samples.emplace_back();
      sample.patch = number * checker::kPatches + static_cast<uint32_t>(patch);
      const int next = std::min(patch + 1, checker::kPatches - 1);
      for (int c = 0; c < 3; c++)
        sample.level[c] = (1.2 - 0.3 * c) * ((1 - beside) * checker::kSrgb[static_cast<size_t>(patch)][c] +
                                             beside * checker::kSrgb[static_cast<size_t>(next)][c]) +
                          number;
    }
    return samples;
  };
  std::vector<ColourSample> samples;
  for (uint32_t number = 0; number < 5; number++) {
    const auto more = chart(number, number == 3 ? 0.3 : 0.02 * number);
    samples.insert(samples.end(), more.begin(), more.end());
  }
  const std::vector<ColourSample> two(samples.begin() + 2 * checker::kPatches, samples.begin() + 4 * checker::kPatches);
  remove_misread_charts(samples);
  EXPECT_EQ(samples.size(), 4u * checker::kPatches);
  for (const ColourSample& sample : samples) EXPECT_NE(sample.patch / checker::kPatches, 3u);
  auto kept = two;
  remove_misread_charts(kept);
  EXPECT_EQ(kept.size(), two.size()) << "two charts have no majority";
}

TEST(SampleQuad, IsTheMeanOfTheInside) {
  Image image(PixelFamily::kRgb, 40, 30);
  for (int y = 0; y < 30; y++)
    for (int x = 0; x < 40; x++) {
      const bool in = x >= 10 && x <= 20 && y >= 5 && y <= 15;
      image.pixel(x, y)[0] = in ? static_cast<uint8_t>(100 + x % 2) : 9;
      image.pixel(x, y)[1] = in ? 60 : 9;
      image.pixel(x, y)[2] = in && x == 12 ? 255 : 100;
    }
  const auto sample = sample_quad(image, {Vec2(10, 5), Vec2(20, 5), Vec2(20, 15), Vec2(10, 15)}).value();
  EXPECT_NEAR(sample.level.x, 100.5, 0.1);
  EXPECT_NEAR(sample.level.y, 60, 1e-9);
  EXPECT_EQ(sample.place, Vec2(15, 10));
  EXPECT_EQ(sample.usable, (std::array<bool, 3>{true, true, false})) << "blue is clipped in a row";
  EXPECT_FALSE(sample_quad(image, {Vec2(-1, 5), Vec2(20, 5), Vec2(20, 15), Vec2(10, 15)})) << "outside";
  EXPECT_FALSE(sample_quad(image, {Vec2(3, 5), Vec2(4, 5), Vec2(4, 6), Vec2(3, 6)})) << "four pixels";
}

class ColourViews : public testing::Test {
 protected:
  static void SetUpTestSuite() { films() = test::scene_images(rig(), 0, 2); }
  static const Rig& rig() {
    static const Rig rig = scene_rig(3, 3, 240, 180);
    return rig;
  }
  static std::vector<Image>& films() {
    static std::vector<Image> films;
    return films;
  }
  static std::vector<Image> with(const std::vector<ColourFault>& faults) {
    std::vector<Image> images;
    for (size_t i = 0; i < films().size(); i++)
      images.push_back(apply_fault(films()[i], faults[i], rig().cameras[i].principal_point(), i));
    return images;
  }
};

TEST_F(ColourViews, SamplesAgreeWithoutFaults) {
  const ColourSamples samples = sample_views(rig(), films());
  EXPECT_GT(samples.patches, 150u);
  EXPECT_GT(samples.all.size(), 5 * samples.patches);
  const ColourDifferences same = colour_differences(rig(), samples, std::vector<ColourModel>(rig().cameras.size()));
  EXPECT_LE(same.median, 1);
}

TEST_F(ColourViews, CorrectsFaultsWithoutAChart) {
  const std::vector<ColourFault> faults = random_faults(9, 3);
  const ColourSamples samples = sample_views(rig(), with(faults));
  const ColourSolution solution = solve_colours(rig(), samples);
  EXPECT_GT(solution.before.median, 4);
  EXPECT_LE(solution.after.median, 1) << solution.terms.name();
  EXPECT_LE(solution.after.p95, 3) << solution.terms.name();
}

TEST_F(ColourViews, CamerasWithoutAnImageAreLeftOut) {
  std::vector<Image> images = films();
  images[3] = Image();
  const ColourSamples samples = sample_views(rig(), images);
  for (const ColourSample& sample : samples.all) ASSERT_NE(sample.camera, 3u);
  EXPECT_GT(samples.patches, 150u);
}

TEST_F(ColourViews, ErrorsNameImagesThatDoNotFit) {
  std::vector<Image> images = films();
  images[2] = Image(PixelFamily::kRgb, 100, 100);
  EXPECT_ERROR(sample_views(rig(), images), "camera 2", "100x100", "240x180");
  images.pop_back();
  EXPECT_ERROR(sample_views(rig(), images), "image", "each camera");
  EXPECT_ERROR(sample_views(rig(), std::vector<Image>(9)), "too little");
}

}  // namespace
}  // namespace lf
