// SPDX-License-Identifier: LGPL-2.1-or-later
#include "quality/frame_times.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace lf {
namespace {

std::vector<double> even(double first, double period, int count) {
  std::vector<double> times;
  for (int i = 0; i < count; i++) times.push_back(first + period * i);
  return times;
}

TEST(FrameTimes, EvenFramesHaveARateAndNothingElse) {
  const FrameTimes times = measure_frame_times(even(1e5, 1 / 30.0, 90));
  EXPECT_EQ(times.frames, 90u);
  EXPECT_NEAR(times.rate(), 30, 1e-6);
  EXPECT_NEAR(times.first, 1e5, 1e-8);
  EXPECT_LT(times.jitter, 1e-8);
  EXPECT_EQ(times.missing, 0u);
  EXPECT_EQ(times.backwards, 0u);
}

TEST(FrameTimes, MissingFramesAreCountedAndDoNotChangeTheRate) {
  std::vector<double> times = even(3, 0.04, 100);
  times.erase(times.begin() + 60, times.begin() + 63);
  times.erase(times.begin() + 10);
  const FrameTimes measured = measure_frame_times(times);
  EXPECT_EQ(measured.missing, 4u);
  EXPECT_NEAR(measured.period, 0.04, 1e-9);
}

TEST(FrameTimes, JitterIsThatOfTheStamps) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 0.002);
  std::vector<double> times = even(0, 1 / 15.0, 300);
  for (double& time : times) time += noise(random);
  const FrameTimes measured = measure_frame_times(times);
  EXPECT_NEAR(measured.jitter, 0.002, 0.0003);
  EXPECT_NEAR(measured.rate(), 15, 0.01);
  EXPECT_EQ(measured.missing, 0u);
}

TEST(FrameTimes, TimesThatGoBackAreCountedAndLeftOut) {
  std::vector<double> times = even(0, 0.1, 20);
  times[10] = times[8];
  const FrameTimes measured = measure_frame_times(times);
  EXPECT_EQ(measured.backwards, 1u);
  EXPECT_NEAR(measured.period, 0.1, 1e-9);
  EXPECT_EQ(measured.missing, 1u) << "the frame came, but nobody knows when it was taken";
}

TEST(FrameTimes, FewFramesTellNothing) {
  for (int count = 0; count < 3; count++) EXPECT_EQ(measure_frame_times(even(0, 0.1, count)).period, 0) << count;
}

TEST(Skew, IsThatOfTheCamerasWhereverTheirPhasesWrap) {
  const double period = 0.04;
  for (const double shift : {0.0, 0.013, 0.0199, 0.039}) {
    const std::vector<FrameTimes> cameras = {measure_frame_times(even(shift, period, 50)),
                                             measure_frame_times(even(shift + 0.004 + period, period, 50)),
                                             measure_frame_times(even(shift - 0.004, period, 50))};
    const Skew skew = measure_skew(cameras);
    EXPECT_NEAR(skew.phase[0], 0, 1e-9) << shift;
    EXPECT_NEAR(skew.phase[1], 0.004, 1e-9) << shift;
    EXPECT_NEAR(skew.phase[2], -0.004, 1e-9) << shift;
    EXPECT_NEAR(skew.spread, 0.008, 1e-9);
    EXPECT_NEAR(skew.drift, 0, 1e-9);
  }
}

TEST(Skew, LeavesOutOtherRatesAndTellsDrift) {
  const std::vector<FrameTimes> cameras = {
      measure_frame_times(even(0, 0.04, 50)), measure_frame_times(even(0, 0.040004, 50)), FrameTimes{},
      measure_frame_times(even(0, 0.1, 50)), measure_frame_times(even(0.01, 0.04, 50))};
  const Skew skew = measure_skew(cameras);
  EXPECT_TRUE(std::isnan(skew.phase[2]));
  EXPECT_TRUE(std::isnan(skew.phase[3]));
  EXPECT_NEAR(skew.drift, 1e-4, 1e-9);
  EXPECT_NEAR(skew.phase[4] - skew.phase[0], 0.01, 1e-4);
  EXPECT_TRUE(measure_skew({}).phase.empty());
}

}  // namespace
}  // namespace lf
