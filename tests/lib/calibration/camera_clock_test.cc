// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/camera_clock.h"

#include "support/test.h"

namespace lf {
namespace {

TEST(CameraClock, TrueTimesAndStampsAreInverse) {
  CameraClock clock;
  clock.offset = 0.02, clock.drift = 1e-4, clock.middle = 5;
  clock.steps = {{3, 0.1, 3}, {7, -0.05, -1}};
  for (const double stamp : {0.0, 2.9, 3.1, 5.0, 6.9, 7.2, 10.0})
    EXPECT_NEAR(clock.stamp_of(clock.true_time(stamp)), stamp, 1e-9) << stamp;
}

std::vector<ClockSample> samples(const std::function<double(double stamp)>& late, double noise) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal(0, noise);
  std::vector<ClockSample> list;
  for (int n = 0; n < 200; n++) list.push_back({n / 20.0, late(n / 20.0) + normal(random), noise});
  for (size_t n = 5; n < list.size(); n += 17) list[n].seconds += 0.02;  // reflections
  return list;
}

TEST(CameraClock, OffsetsAreRobustToOutliers) {
  CameraClock clock;
  clock.offset = 1;
  const double added = refine_clock(clock, samples([](double) { return 0.004; }, 5e-4), 1.0 / 30, 1);
  EXPECT_NEAR(added, 0.004, 2e-4);
  EXPECT_NEAR(clock.offset, 1.004, 2e-4);
  EXPECT_EQ(clock.drift, 0);
  EXPECT_TRUE(clock.steps.empty());
  EXPECT_GT(clock.sigma, 1e-5);
  EXPECT_LT(clock.sigma, 1e-4);
}

TEST(CameraClock, AbsorbedOffsetsAreLessCertain) {
  CameraClock clock;
  const auto late = samples([](double) { return 0.002; }, 5e-4);
  CameraClock other;
  EXPECT_NEAR(refine_clock(clock, late, 1.0 / 30, 1), 0.002, 2e-4);
  refine_clock(other, late, 1.0 / 30, 0.25);
  EXPECT_NEAR(other.sigma, 2 * clock.sigma, 1e-9);
}

TEST(CameraClock, EstimatesDrift) {
  CameraClock clock;
  refine_clock(clock, samples([](double stamp) { return 1e-3 * (stamp - 5); }, 5e-4), 1.0 / 30, 1);
  EXPECT_NEAR(clock.drift, 1e-3, 5e-5);
  EXPECT_TRUE(clock.steps.empty());
}

TEST(CameraClock, CountsDroppedFrames) {
  CameraClock clock;
  const auto late = [](double stamp) { return stamp < 4 ? 0.001 : stamp < 8 ? 0.001 + 1 / 30.0 : 0.001 + 3 / 30.0; };
  refine_clock(clock, samples(late, 5e-4), 1.0 / 30, 1);
  ASSERT_EQ(clock.steps.size(), 2u);
  EXPECT_EQ(clock.steps[0].frames, 1);
  EXPECT_NEAR(clock.steps[0].stamp, 4, 0.06);
  EXPECT_EQ(clock.steps[1].frames, 2);
  EXPECT_NEAR(clock.steps[1].stamp, 8, 0.06);
  EXPECT_NEAR(clock.offset, 0.001, 2e-4);
}

}  // namespace
}  // namespace lf
