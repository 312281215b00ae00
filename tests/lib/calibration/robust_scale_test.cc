// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/robust_scale.h"

#include <random>

#include <gtest/gtest.h>

namespace lf {
namespace {

TEST(RobustScale, SigmaOfNormalErrorsWhateverTheRestIs) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal(0, 0.25);
  std::vector<double> lengths;
  for (int i = 0; i < 20000; i++) lengths.push_back(std::hypot(normal(random), normal(random)));
  EXPECT_NEAR(robust_sigma(lengths), 0.25, 0.005);
  for (int i = 0; i < 2000; i++) lengths.push_back(100);
  for (int i = 0; i < 2000; i++) lengths.push_back(-1);  // without a residual
  EXPECT_NEAR(robust_sigma(lengths), 0.25, 0.03);
  EXPECT_EQ(robust_sigma({}), 0);
}

TEST(RobustScale, WhatHasNoResidualIsNoInlier) { EXPECT_EQ(within({-1, 0, 0.5, 0.7}, 3, 0.2), (Inliers{0, 1, 1, 0})); }

}  // namespace
}  // namespace lf
