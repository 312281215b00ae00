// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/camera_gains.h"

#include <gtest/gtest.h>

#include <cmath>

namespace lf {
namespace {

TEST(CameraGains, GoToWhatIsMeasured) {
  CameraGains gains;
  EXPECT_EQ(gains.of(3), 1);
  for (int i = 0; i < 5; i++) gains.update(3, 1.1f / gains.of(3));
  EXPECT_NEAR(gains.of(3), 1.1, 0.001);
  EXPECT_EQ(gains.of(4), 1);
  EXPECT_EQ(gains.all().size(), 1u);
}

TEST(CameraGains, StayInRange) {
  CameraGains gains;
  for (int i = 0; i < 9; i++) {
    gains.update(1, 10);
    gains.update(2, 0.01f);
  }
  EXPECT_EQ(gains.of(1), CameraGains::kMost);
  EXPECT_EQ(gains.of(2), CameraGains::kLeast);
}

}  // namespace
}  // namespace lf
