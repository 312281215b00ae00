// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/colour_views.h"

#include <gtest/gtest.h>

#include "calibration/colour_solve.h"
#include "scene/colour_faults.h"
#include "scene/scene.h"
#include "support/expect_error.h"

namespace lf {
namespace {

class ColourViews : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    for (const Camera& camera : rig().cameras)
      films().push_back(render_scene({camera.width, camera.height, camera.lens, camera.pose}, 0));
  }
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
      images.push_back(with_fault(films()[i], faults[i], rig().cameras[i].principal_point(), i));
    return images;
  }
};

TEST_F(ColourViews, PlacesOfTheSceneLookTheSameFromCamerasWithoutFaults) {
  const ColourSamples samples = sample_views(rig(), films());
  EXPECT_GT(samples.patches, 150u);
  EXPECT_GT(samples.all.size(), 5 * samples.patches);
  const ColourDifferences same = colour_differences(rig(), samples, std::vector<ColourModel>(rig().cameras.size()));
  EXPECT_LE(same.median, 1);
}

TEST_F(ColourViews, CamerasWithFaultsComeToAgreeOnTheSceneWithoutAChart) {
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

TEST_F(ColourViews, ImagesThatDoNotFitAreNamed) {
  std::vector<Image> images = films();
  images[2] = Image(PixelFamily::kRgb, 100, 100);
  EXPECT_ERROR(sample_views(rig(), images), "camera 2: its image has 100x100 pixels, the rig says 240x180");
  images.pop_back();
  EXPECT_ERROR(sample_views(rig(), images), "an image for each camera");
  EXPECT_ERROR(sample_views(rig(), std::vector<Image>(9)), "too little");
}

}  // namespace
}  // namespace lf
