// SPDX-License-Identifier: LGPL-2.1-or-later
#include "geometry/pose.h"

namespace lf {

Pose look_at(const Vec3& eye, const Vec3& target, const Vec3& down) {
  const Vec3 z = glm::normalize(target - eye);
  const Vec3 x = glm::normalize(glm::cross(down, z));
  const Vec3 y = glm::cross(z, x);
  return {eye, glm::normalize(glm::quat_cast(Mat3(x, y, z)))};
}

namespace {

constexpr double kPole = 1e-12;  // sqrt(2) sin of half the angle to straight up or down

}  // namespace

Quat quat_from_euler(const Euler& degrees) {
  const auto turn = [](double angle_deg, const Vec3& axis) { return glm::angleAxis(angle_deg * (M_PI / 180), axis); };
  return glm::normalize(turn(degrees.yaw, {0, 1, 0}) * turn(degrees.pitch, {1, 0, 0}) * turn(degrees.roll, {0, 0, 1}));
}

// With half angles y, p, r of yaw, pitch, roll the product of the three turns is
//   w + qx = (cos p + sin p) cos(y - r),  qy - qz = (cos p + sin p) sin(y - r),
//   w - qx = (cos p - sin p) cos(y + r),  qy + qz = (cos p - sin p) sin(y + r),
// so that near a pole only the angle that no longer matters loses digits.
Euler euler_from_quat(const Quat& orientation) {
  const Quat q = glm::normalize(orientation);
  const double up = std::hypot(q.w + q.x, q.y - q.z), down = std::hypot(q.w - q.x, q.y + q.z);
  const double difference = std::atan2(q.y - q.z, q.w + q.x), sum = std::atan2(q.y + q.z, q.w - q.x);
  double yaw = sum + difference, roll = sum - difference;
  if (down < kPole || up < kPole) {
    yaw = 2 * (down < kPole ? difference : sum);
    roll = 0;
  }
  const double pitch = 2 * std::atan2(up, down) - M_PI / 2;
  return {std::remainder(yaw, 2 * M_PI) * (180 / M_PI), pitch * (180 / M_PI),
          std::remainder(roll, 2 * M_PI) * (180 / M_PI)};
}

}  // namespace lf
