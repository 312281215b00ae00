// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/model_choice.h"

#include <gtest/gtest.h>

#include "calibration/simulator.h"

namespace lf {
namespace {

struct Chosen {
  AdjustmentOptions options;
  std::vector<ModelTrial> trials;
};

// From near the truth, as after a first adjustment.
Chosen choose(double focal_spread, double centre_spread) {
  sim::ArrayOptions array;
  array.rows = array.columns = 4;
  array.focal_spread = focal_spread, array.centre_spread = centre_spread;
  array.k1_spread = array.k2_spread = 0;
  const Rig truth = sim::make_array(array, 1);
  sim::PathOptions path;
  path.positions = 150, path.noise = 0.1;
  const sim::Watched watched = sim::watch(truth, path, 2);
  SolveOptions none;
  Reconstruction scene = sim::true_scene(truth, watched, none);
  Chosen chosen;
  apply_model({2, true}, chosen.options);
  choose_alike(scene, watched.tracks, chosen.options, chosen.trials);
  return chosen;
}

TEST(ModelChoice, LensesThatAreAlikeStayAlike) {
  const Chosen chosen = choose(0, 0);
  EXPECT_TRUE(chosen.options.shared[kF]);
  EXPECT_TRUE(chosen.options.shared[kCx] && chosen.options.shared[kCy]);
  ASSERT_EQ(chosen.trials.size(), 3u);
  EXPECT_TRUE(chosen.trials[0].chosen);
}

TEST(ModelChoice, FocalLengthsThatDifferAreFree) {
  const Chosen chosen = choose(0.02, 0);
  EXPECT_FALSE(chosen.options.shared[kF]);
  EXPECT_TRUE(chosen.options.shared[kCx] && chosen.options.shared[kCy]);
}

TEST(ModelChoice, PrincipalPointsThatDifferAreFree) {
  const Chosen chosen = choose(0.02, 20);
  EXPECT_FALSE(chosen.options.shared[kF]);
  EXPECT_FALSE(chosen.options.shared[kCx] || chosen.options.shared[kCy]);
}

// Starts at the truth, but for lens terms: what a model needs is all that can be said against it.
ModelChoice choose_terms(const sim::ArrayOptions& array, Reconstruction* found = nullptr) {
  const Rig truth = sim::make_array(array, 1);
  sim::PathOptions path;
  path.bar = 0.3;
  const sim::Watched watched = sim::watch(truth, path, 2);
  Reconstruction scene = sim::true_scene(truth, watched, {});
  for (CameraState& camera : scene.cameras) camera.lens_terms()[kK1] = camera.lens_terms()[kK2] = 0;
  const ModelChoice choice = choose_distortion(scene, watched.tracks, {}, watched.tracks.observations.size());
  if (found) *found = scene;
  return choice;
}

sim::ArrayOptions array_with(double k1, double k1_spread) {
  sim::ArrayOptions array;
  array.rows = array.columns = 4;
  array.k1 = k1, array.k1_spread = k1_spread;
  array.k2 = array.k2_spread = 0;
  return array;
}

TEST(ModelChoice, NoDistortionWhereThereIsNone) {
  EXPECT_EQ(choose_terms(array_with(0, 0)).model, (DistortionModel{0, false}));
}

TEST(ModelChoice, OneTermForAll) {
  Reconstruction scene;
  const ModelChoice choice = choose_terms(array_with(-0.15, 0), &scene);
  EXPECT_EQ(choice.model, (DistortionModel{1, true}));
  for (const CameraState& camera : scene.cameras) {
    EXPECT_NEAR(camera.lens_terms()[kK1], -0.15, 0.03);
    EXPECT_EQ(camera.lens_terms()[kK2], 0);
  }
}

TEST(ModelChoice, OneTermACamera) {
  EXPECT_EQ(choose_terms(array_with(-0.15, 0.1)).model, (DistortionModel{1, false}));
}

TEST(ModelChoice, TheTableShowsAll) {
  const ModelChoice choice = choose_terms(array_with(-0.15, 0));
  ASSERT_EQ(choice.trials.size(), 5u);
  int chosen = 0;
  for (const ModelTrial& trial : choice.trials) chosen += trial.chosen;
  EXPECT_EQ(chosen, 1);
  EXPECT_EQ(choice.trials[0].model, "none");
  EXPECT_TRUE(choice.trials[1].chosen);
  EXPECT_LT(choice.trials[1].bic, choice.trials[0].bic);
  EXPECT_LT(*choice.trials[1].transfer_px, *choice.trials[0].transfer_px);
}

TEST(ModelChoice, FreeTermsOfEachModel) {
  AdjustmentOptions options;
  apply_model({1, true}, options);
  EXPECT_EQ(options.free, (std::array<bool, kNumLensTerms>{true, true, true, true, false}));
  EXPECT_TRUE(options.shared[kK1]);
  EXPECT_FALSE(options.shared[kF]);
  apply_model({2, false}, options);
  EXPECT_TRUE(options.free[kK2]);
  EXPECT_FALSE(options.shared[kK1]);
}

}  // namespace
}  // namespace lf
