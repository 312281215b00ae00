// SPDX-License-Identifier: LGPL-2.1-or-later
#include "geometry/pose.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace lf {
namespace {

double max_difference(const Mat3& a, const Mat3& b) {
  double worst = 0;
  for (int c = 0; c < 3; c++)
    for (int r = 0; r < 3; r++) worst = std::max(worst, std::abs(a[c][r] - b[c][r]));
  return worst;
}

TEST(Euler, SignsAreThoseOfTheHeader) {
  const auto axes = [](double yaw, double pitch, double roll) {
    return glm::mat3_cast(quat_from_euler({yaw, pitch, roll}));
  };
  EXPECT_NEAR(axes(90, 0, 0)[2].x, 1, 1e-15);   // forward is now right
  EXPECT_NEAR(axes(0, 90, 0)[2].y, -1, 1e-15);  // forward is now up
  EXPECT_NEAR(axes(0, 0, 90)[0].y, 1, 1e-15);   // right is now down
  // Yaw first: after a right turn, pitch still looks up.
  const Vec3 forward = axes(90, 30, 0)[2];
  EXPECT_NEAR(forward.x, std::cos(M_PI / 6), 1e-15);
  EXPECT_NEAR(forward.y, -0.5, 1e-15);
}

TEST(Euler, RoundTripOfAngles) {
  for (double yaw = -180; yaw <= 180; yaw += 22.5)
    for (double pitch = -85; pitch <= 85; pitch += 17)
      for (double roll = -170; roll <= 180; roll += 35) {
        const Euler e = euler_from_quat(quat_from_euler({yaw, pitch, roll}));
        EXPECT_NEAR(std::remainder(e.yaw - yaw, 360), 0, 1e-12);
        EXPECT_NEAR(e.pitch, pitch, 1e-12);
        EXPECT_NEAR(std::remainder(e.roll - roll, 360), 0, 1e-12);
      }
}

TEST(Euler, PolesKeepTheOrientation) {
  for (double pitch : {90.0, -90.0, 90 - 1e-5, -90 + 1e-7, 90 - 1e-9})
    for (double yaw : {-120.0, 0.0, 30.0}) {
      const Quat q = quat_from_euler({yaw, pitch, 25});
      const Quat back = quat_from_euler(euler_from_quat(q));
      EXPECT_LT(max_difference(glm::mat3_cast(q), glm::mat3_cast(back)), 1e-14) << pitch << " " << yaw;
    }
}

}  // namespace
}  // namespace lf
