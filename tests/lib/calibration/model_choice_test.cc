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
  Scene scene = sim::true_scene(truth, watched, none);
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

}  // namespace
}  // namespace lf
