// SPDX-License-Identifier: LGPL-2.1-or-later
// How good solutions are is what tests/calibration/accuracy_test.cc and hard_cases_test.cc show.
#include "calibration/solve.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "calibration/noise.h"
#include "calibration/simulator.h"

namespace lf {
namespace {

using testing::HasSubstr;

class SolveTest : public testing::Test {
 protected:
  const Rig truth_ = sim::make_array({.rows = 3, .columns = 3}, 1);
  sim::Watched watched_ = sim::watch(truth_, {.positions = 60, .outliers = 0.05}, 2);
  std::string error_of(const Tracks& tracks, const SolveOptions& options) {
    try {
      solve_tracks(tracks, options);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
};

TEST_F(SolveTest, FindsCamerasLightsAndNoise) {
  SolveOptions options;
  sim::measure_lenses(truth_, {}, 3, options);
  const Solution solution = solve_tracks(watched_.tracks, options);
  ASSERT_EQ(solution.inliers.size(), watched_.tracks.observations.size());
  for (const CameraState& camera : solution.scene.cameras) EXPECT_TRUE(camera.used);
  EXPECT_NEAR(solution.sigma, 0.2, 0.03);
  const std::vector<double> lengths = residual_lengths(solution.scene, watched_.tracks.observations);
  size_t wrong = 0;
  for (size_t i = 0; i < lengths.size(); i++) wrong += (solution.inliers[i] != 0) != (watched_.good[i] != 0);
  EXPECT_LT(wrong, lengths.size() / 50);
  EXPECT_EQ(solution.uncertainty.camera_row.size(), 9u);
}

TEST_F(SolveTest, IsTheSameEveryTime) {
  const Solution a = solve_tracks(watched_.tracks, {.distortion = DistortionModel{1, true}});
  const Solution b = solve_tracks(watched_.tracks, {.distortion = DistortionModel{1, true}});
  for (size_t i = 0; i < 9; i++)
    for (int k = 0; k < CameraState::kSize; k++)
      EXPECT_NEAR(a.scene.cameras[i].v[k], b.scene.cameras[i].v[k], 1e-6) << i << ", " << k;
  EXPECT_EQ(a.inliers, b.inliers);
}

TEST_F(SolveTest, KeepsTheModelThatItIsTold) {
  const Solution solution = solve_tracks(watched_.tracks, {.distortion = DistortionModel{0, false}});
  EXPECT_EQ(solution.distortion, (DistortionModel{0, false}));
  EXPECT_TRUE(solution.trials.empty());
  EXPECT_FALSE(solution.model.free[kK1]);
  for (const CameraState& camera : solution.scene.cameras) EXPECT_EQ(camera.lens_terms()[kK1], 0);
}

TEST_F(SolveTest, SaysWhatItDoesAndMayBeCancelled) {
  std::vector<std::string> steps;
  SolveOptions options;
  options.distortion = DistortionModel{1, true};
  options.progress = [&](const std::string& step) { steps.push_back(step); };
  solve_tracks(watched_.tracks, options);
  EXPECT_GT(steps.size(), 2u);
  options.progress = [](const std::string&) { throw Error("cancelled"); };
  EXPECT_EQ(error_of(watched_.tracks, options), "cancelled");
}

TEST_F(SolveTest, ErrorsNameThePlace) {
  Tracks one = watched_.tracks;
  one.cameras.resize(1);
  std::erase_if(one.observations, [](const Observation& o) { return o.camera > 0; });
  EXPECT_THAT(error_of(one, {}), HasSubstr("two cameras"));
  SolveOptions options;
  options.prior = truth_;
  options.prior->cameras.pop_back();
  EXPECT_THAT(error_of(watched_.tracks, options), HasSubstr("no camera with id 8"));
  options.prior = truth_;
  options.prior->cameras[2].width = 99;
  EXPECT_THAT(error_of(watched_.tracks, options), HasSubstr("camera 2"));
  Tracks alone = watched_.tracks;  // no light is seen by two cameras
  std::erase_if(alone.observations, [](const Observation& o) { return o.position % 9 != o.camera; });
  EXPECT_THAT(error_of(alone, {}), HasSubstr("no two cameras see the light"));
}

}  // namespace
}  // namespace lf
