// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/camera_gains.h"

#include <gtest/gtest.h>

#include <cmath>

namespace lf {
namespace {

TEST(CameraGains, GoToWhatIsMeasured) {
  CameraGains gains;
  EXPECT_EQ(gains.of(3), 1);
  gains.update(3, 1.2f);
  for (int i = 0; i < 5; i++) gains.update(3, 1.1f / gains.of(3));
  EXPECT_NEAR(gains.measured().at(3), 1.1, 0.001);
  EXPECT_NEAR(gains.of(3), 1.1, 0.005);
  EXPECT_EQ(gains.of(4), 1);
  EXPECT_EQ(gains.measured().size(), 1u);
}

TEST(CameraGains, LittleIsMadeOfWhatMayBeShine) {
  CameraGains gains;
  EXPECT_EQ(gains.trust(1), 1);
  float before = 1;
  for (const float gain : {1.005f, 1.01f, 1.02f, 1.05f, 1.1f, 1.5f}) {
    gains.update(1, gain / gains.of(1));
    gains.update(2, 1 / gain / gains.of(2));
    EXPECT_NEAR(gains.of(1) * gains.of(2), 1, 1e-5) << "too bright as too dark";
    const double x = std::log(gain), shine = CameraGains::kShine;
    EXPECT_NEAR(gains.trust(1), 1 / (1 + x * x / (shine * shine)), 1e-4);
    EXPECT_NEAR(std::log(gains.of(1)), (1 - gains.trust(1)) * x, 1e-5);
    EXPECT_GT(gains.of(1), before);
    before = gains.of(1);
  }
}

TEST(CameraGains, StayInRange) {
  CameraGains gains;
  for (int i = 0; i < 9; i++) {
    gains.update(1, 10);
    gains.update(2, 0.01f);
  }
  EXPECT_EQ(gains.measured().at(1), CameraGains::kMost);
  EXPECT_EQ(gains.measured().at(2), CameraGains::kLeast);
}

}  // namespace
}  // namespace lf
