// SPDX-License-Identifier: LGPL-2.1-or-later
// What cameras' colours cost a picture that is focused everywhere, and what is left of it once they are measured.
#include <gtest/gtest.h>

#include "calibration/colour_solve.h"
#include "calibration/colour_views.h"
#include "composite/still.h"
#include "focus/view_focus.h"
#include "image/colour_correction.h"
#include "quality/quality.h"
#include "scene/colour_faults.h"
#include "scene/scene.h"

namespace lf {
namespace {

// Through the focal surface that is found in the images, against the scene itself.
double surface_db(const Rig& rig, const std::vector<Image>& images, const View& view, const Image& truth) {
  const Mesh mesh = build_mesh(rig);
  const CameraImages image_of = [&](CameraIndex i) -> const Image& { return images[i]; };
  const View focused = focus_still(rig, mesh, view, image_of, {.mode = FocusMode::kSurface});
  const Still still = render_still(rig, mesh, focused, image_of, Resampling::kSharpened);
  return compare(still.picture, truth, still.coverage).psnr_db;
}

TEST(ColourQuality, EveryFourthCameraOffByTenPercentCostsNextToNothingOnceMeasured) {
  const Rig rig = scene_rig(4, 4, 320, 240);
  std::vector<Image> good, wrong;
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    const Camera& camera = rig.cameras[i];
    good.push_back(render_scene({camera.width, camera.height, camera.lens, camera.pose}, 0));
    wrong.push_back(with_fault(good.back(), {.gain = i % 4 == 1 ? 1.1 : 1.0}, camera.principal_point(), i));
  }
  const ColourSolution solution = solve_colours(rig, sample_views(rig, wrong));
  EXPECT_EQ(solution.terms, ColourTerms()) << "brightness alone is off: " << solution.terms.name();
  // Gains are over those of most cameras. Corrections make the colours of the mean camera: the truth is as much
  // brighter.
  for (size_t i = 0; i < solution.cameras.size(); i++)
    EXPECT_NEAR(solution.cameras[i].gain, i % 4 == 1 ? 1.1 : 1, 0.01) << i;

  View view{.width = 320,
            .height = 240,
            .lens = rig.cameras[0].lens,
            .pose = {{0.013, -0.008, 0}, {1, 0, 0, 0}},
            .focus = {}};
  view.focus.plane = plane_through({0, 0, kSceneMiddle}, {0, 0, 1});
  const Image truth = render_scene({view.width, view.height, view.lens, view.pose}, 0);
  ColourFault all{.gain = std::pow(1.1, 0.25)};
  const Image brighter = with_fault(truth, all, {159.5, 119.5}, 0);
  std::vector<Image> corrected_images, equal;
  for (size_t i = 0; i < wrong.size(); i++) {
    corrected_images.push_back(corrected(wrong[i], *solution.models[i], rig.cameras[i].principal_point()));
    equal.push_back(with_fault(good[i], all, {159.5, 119.5}, i));
  }
  const double best = surface_db(rig, equal, view, brighter), with_faults = surface_db(rig, wrong, view, brighter),
               after = surface_db(rig, corrected_images, view, brighter);
  RecordProperty("psnr_db", "equal " + std::to_string(best) + ", off " + std::to_string(with_faults) + ", corrected " +
                                std::to_string(after));
  EXPECT_LE(with_faults, best - 1) << "it is worth it";
  EXPECT_GE(after, best - 0.3);
}

}  // namespace
}  // namespace lf
