// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/moments.h"

#include <gtest/gtest.h>

#include <cmath>

namespace lf {
namespace {

Moments of(double weight, double luma) {
  Moments moments;
  moments.reset(1, 1);
  moments.weight[0] = static_cast<uint16_t>(std::lround(weight * Moments::kWeightOne));
  moments.luma[0] = static_cast<uint16_t>(std::lround(weight * luma * Moments::kLumaOne));
  moments.square[0] = static_cast<uint16_t>(std::lround(weight * luma * luma));
  return moments;
}

TEST(Moments, DeviateAsTheWeightedLumaDoes) {
  Moments sum = of(0.25, 100);
  sum.add(of(0.75, 180));
  EXPECT_NEAR(sum.deviation(0), 80 * std::sqrt(0.25 * 0.75), 0.05);
}

TEST(Moments, AgreeingCamerasDoNotDeviate) {
  for (const double luma : {0.0, 17.0, 128.0, 255.0}) {
    Moments sum = of(0.3, luma);
    sum.add(of(0.3, luma));
    sum.add(of(0.4, luma));
    EXPECT_LT(sum.deviation(0), 2) << luma << ": what rounding squares to 16 bits leaves";
  }
}

TEST(Moments, PartOfTheWeightIsEnoughButNotLessThanHalf) {
  EXPECT_NEAR(of(0.6, 100).deviation(0), 0, 1.5);
  EXPECT_TRUE(std::isnan(of(0.4, 100).deviation(0)));
  EXPECT_TRUE(std::isnan(of(0, 0).deviation(0)));
}

TEST(Moments, SaturateWhereCamerasAreCountedTwice) {
  Moments sum = of(1, 255);
  sum.add(of(1, 255));
  sum.add(of(1, 255));
  EXPECT_EQ(sum.weight[0], 65535);
  EXPECT_EQ(sum.luma[0], 65535);
  EXPECT_EQ(sum.square[0], 65535);
}

}  // namespace
}  // namespace lf
