// SPDX-License-Identifier: LGPL-2.1-or-later
// That the covariance is right is what tests/calibration/accuracy_test.cc shows over many seeds.
#include "calibration/uncertainty.h"

#include <gtest/gtest.h>

#include "calibration/simulator.h"

namespace lf {
namespace {

class UncertaintyTest : public testing::Test {
 protected:
  UncertaintyTest() {
    sim::ArrayOptions array;
    array.rows = array.columns = 3;
    truth_ = sim::make_array(array, 1);
    watched_ = sim::watch(truth_, {}, 2);
    sim::measure_lenses(truth_, {}, 3, options_);
    scene_ = sim::true_scene(truth_, watched_, options_);
    model_.free = {true, true, true, true, true};
    model_.sigma = 0.2;
  }
  Uncertainty estimate() { return estimate_uncertainty(scene_, watched_.tracks.observations, watched_.good, model_); }

  Rig truth_;
  sim::Watched watched_;
  SolveOptions options_;
  Reconstruction scene_;
  AdjustmentOptions model_;
};

TEST_F(UncertaintyTest, HasRowsForWhatIsUsedAndFree) {
  scene_.cameras[4].used = false;
  model_.free[kK2] = false;
  const Uncertainty u = estimate();
  EXPECT_EQ(u.camera_size, 10);
  EXPECT_EQ(u.covariance.rows(), 80);
  EXPECT_EQ(u.prior_covariance.rows(), 32);
  EXPECT_EQ(u.camera_row[4], -1);
  EXPECT_EQ(u.camera_row[5], 40);
  EXPECT_EQ(u.lens_terms, (std::vector<int>{kF, kCx, kCy, kK1}));
  EXPECT_GT(u.covariance.diagonal().minCoeff(), 0);
}

TEST_F(UncertaintyTest, GrowsWithTheNoiseUpToWhatWasKnown) {
  model_.free = {true};
  const double before = estimate().covariance(6, 6);
  model_.sigma *= 2;
  const Uncertainty noisy = estimate();
  EXPECT_GT(noisy.covariance(6, 6), before);
  EXPECT_LT(noisy.covariance(6, 6), noisy.prior_covariance(0, 0));
  // An observation's own sigma counts as that of all.
  for (Observation& o : watched_.tracks.observations) o.sigma = 2;
  model_.sigma /= 2;
  EXPECT_NEAR(estimate().covariance(6, 6), noisy.covariance(6, 6), 1e-9 * before);
}

// Moving, turning or scaling all cameras is no error: the centres' common steps have no variance.
TEST_F(UncertaintyTest, IsInTheAlignedGauge) {
  const Uncertainty u = estimate();
  for (int axis = 0; axis < 3; axis++) {
    Eigen::VectorXd all = Eigen::VectorXd::Zero(u.covariance.rows());
    for (const int row : u.camera_row) all[row + 3 + axis] = 1;
    EXPECT_NEAR(all.dot(u.covariance * all), 0, 1e-6 * u.covariance(3 + axis, 3 + axis));
  }
}

}  // namespace
}  // namespace lf
