// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gtest/gtest.h>

#include <algorithm>

#include "calibration/adjustment.h"
#include "calibration/noise.h"
#include "calibration/simulator.h"

namespace lf {
namespace {

// A scene at the truth, of lights or bars, and what is wrong before it is adjusted.
class BundleAdjustmentTest : public testing::TestWithParam<double> {
 protected:
  void watch(double noise, double outliers) {
    sim::PathOptions path;
    path.bar = GetParam();
    path.noise = noise;
    path.outliers = outliers;
    watched_ = sim::watch(truth_, path, 2);
    sim::measure_lenses(truth_, {}, 3, known_);
    scene_ = sim::true_scene(truth_, watched_, known_);
    scene_.lens_priors.assign(scene_.cameras.size(), {});
    use_.assign(observations().size(), true);
  }
  const std::vector<Observation>& observations() const { return watched_.tracks.observations; }
  void push_away() {
    std::mt19937_64 random(4);
    std::normal_distribution<double> normal;
    for (CameraState& camera : scene_.cameras) {
      Pose pose = camera.pose();
      pose.position += 0.01 * Vec3(normal(random), normal(random), normal(random));
      pose.orientation =
          Quat(1, 0.01 * normal(random), 0.01 * normal(random), 0.01 * normal(random)) * pose.orientation;
      camera.set_pose({pose.position, glm::normalize(pose.orientation)});
    }
    for (TargetState& target : scene_.targets)
      for (int k = 0; k < 3; k++) target.v[k] += 0.02 * normal(random);
  }
  // Over the good observations.
  double largest_residual() const {
    double largest = 0;
    const std::vector<double> lengths = residual_lengths(scene_, observations());
    for (size_t i = 0; i < lengths.size(); i++)
      if (watched_.good[i]) largest = std::max(largest, lengths[i]);
    return largest;
  }

  const Rig truth_ = sim::make_array({.rows = 3, .columns = 3}, 1);
  SolveOptions known_;
  sim::Watched watched_;
  Reconstruction scene_;
  Inliers use_;
};

TEST_P(BundleAdjustmentTest, EndsWhereEveryRayMeetsItsLight) {
  watch(0, 0);
  EXPECT_LT(largest_residual(), 1e-6);
  push_away();
  EXPECT_GT(largest_residual(), 1);
  const Reconstruction before = scene_;
  const AdjustmentSummary summary = adjust(scene_, observations(), use_, {.tolerance = 1e-16});
  EXPECT_TRUE(summary.ok);
  EXPECT_LT(largest_residual(), 1e-4);
  for (size_t i = 0; i < scene_.cameras.size(); i++)
    for (int k = 0; k < kNumLensTerms; k++)
      EXPECT_EQ(scene_.cameras[i].lens_terms()[k], before.cameras[i].lens_terms()[k]) << "was not free";
}

TEST_P(BundleAdjustmentTest, LensesComeRightThatAreFree) {
  watch(0, 0);
  const Reconstruction exact = scene_;
  for (CameraState& camera : scene_.cameras) camera.lens_terms()[kF] *= 1.02;
  AdjustmentOptions options{.sigma = 1e-3, .tolerance = 1e-16};
  options.free[kF] = true;
  adjust(scene_, observations(), use_, options);
  for (size_t i = 0; i < scene_.cameras.size(); i++)
    EXPECT_NEAR(scene_.cameras[i].lens_terms()[kF] / exact.cameras[i].lens_terms()[kF], 1, 1e-3) << i;
}

TEST_P(BundleAdjustmentTest, StaysWhereItIsTold) {
  watch(0.2, 0);
  const Reconstruction before = scene_;
  adjust(scene_, observations(), use_, {.free_poses = false});
  for (size_t i = 0; i < scene_.cameras.size(); i++) EXPECT_EQ(scene_.cameras[i].v, before.cameras[i].v);
  EXPECT_NE(scene_.targets[5].v, before.targets[5].v);
  scene_ = before;
  adjust(scene_, observations(), use_, {.free_targets = false});
  EXPECT_NE(scene_.cameras[4].v, before.cameras[4].v);
  for (size_t i = 0; i < scene_.targets.size(); i++) EXPECT_EQ(scene_.targets[i].v, before.targets[i].v);
}

TEST_P(BundleAdjustmentTest, OutliersMoveItLessWhereItIsRobust) {
  watch(0.2, 0.1);
  const Reconstruction before = scene_;
  adjust(scene_, observations(), use_, {.sigma = 0.2});
  const double least_squares = largest_residual();
  scene_ = before;
  adjust(scene_, observations(), use_, {.sigma = 0.2, .robust = 3});
  EXPECT_LT(largest_residual(), 1.5);
  EXPECT_GT(least_squares, 3 * largest_residual());
  // Nor do they where they are told not to be used.
  scene_ = before;
  adjust(scene_, observations(), watched_.good, {.sigma = 0.2});
  EXPECT_LT(largest_residual(), 1.5);
}

TEST_P(BundleAdjustmentTest, WhatIsNotUsedIsLeftAlone) {
  watch(0.2, 0);
  push_away();
  scene_.cameras[4].used = false;
  const Reconstruction before = scene_;
  adjust(scene_, observations(), use_, {});
  EXPECT_EQ(scene_.cameras[4].v, before.cameras[4].v);
  EXPECT_NE(scene_.cameras[3].v, before.cameras[3].v);
}

INSTANTIATE_TEST_SUITE_P(LightOrBar, BundleAdjustmentTest, testing::Values(0, 0.3));

}  // namespace
}  // namespace lf
