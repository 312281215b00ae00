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

}  // namespace lf
