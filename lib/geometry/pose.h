// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "base/vec.h"

namespace lf {

// a x + b y + c z + d = 0 in world coordinates; normal = (a, b, c) has unit length, d in metres.
struct Plane {
  Vec3 normal{0, 0, 1};
  double d = 0;

  double signed_distance(const Vec3& x_world) const { return glm::dot(normal, x_world) + d; }
  bool operator==(const Plane&) const = default;
};

inline Plane plane_through(const Vec3& point, const Vec3& unit_normal) {
  return {unit_normal, -glm::dot(unit_normal, point)};
}

// world_from_camera. Axes of world and camera alike: right-handed, x right, y down, z forward (OpenCV, COLMAP).
struct Pose {
  Vec3 position{0, 0, 0};        // centre of projection in the world, metres
  Quat orientation{1, 0, 0, 0};  // w, x, y, z; unit norm

  // world_from_camera; a rotation however far within kUnitTolerance |orientation| is from 1.
  Mat3 rotation() const { return glm::mat3_cast(glm::normalize(orientation)); }
  Vec3 forward() const { return rotation()[2]; }  // optical axis in the world, unit length
  Vec3 right() const { return rotation()[0]; }
  Vec3 down() const { return rotation()[1]; }

  Vec3 world_from_camera(const Vec3& x_camera) const { return rotation() * x_camera + position; }
  Vec3 camera_from_world(const Vec3& x_world) const { return glm::transpose(rotation()) * (x_world - position); }

  bool operator==(const Pose&) const = default;
};

// Pose at `eye` looking at `target`, with the camera's y axis as near to `down` as it can be.
// Requires eye != target and the line of sight not parallel to `down`.
Pose look_at(const Vec3& eye, const Vec3& target, const Vec3& down);

// An orientation as people type it, in degrees; right-handed turns about the camera's own axes, applied yaw first:
// R = Ry(yaw) Rx(pitch) Rz(roll). With x right, y down, z forward: yaw > 0 turns right, pitch > 0 looks up, roll > 0
// turns the camera clockwise (as seen from behind it). All zero: axes along the world's.
struct Euler {
  double yaw = 0, pitch = 0, roll = 0;
};

Quat quat_from_euler(const Euler& degrees);  // unit norm
// yaw and roll in [-180, 180], pitch in [-90, 90]; straight up or down roll is 0 and yaw carries both.
// quat_from_euler() of the result is the same orientation to 1e-14 everywhere.
Euler euler_from_quat(const Quat& orientation);

}  // namespace lf
