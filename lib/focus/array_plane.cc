// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/array_plane.h"

namespace lf {

Plane array_plane(const Rig& rig) {
  // Means of differences: an array far from the origin keeps its precision.
  const Vec3 first = rig.cameras[0].pose.position;
  Vec3 offset(0), axis(0);
  for (const Camera& camera : rig.cameras) {
    offset += camera.pose.position - first;
    axis += camera.pose.forward();
  }
  constexpr double kNoDirection = 1e-6;
  const auto count = static_cast<double>(rig.cameras.size());
  const Vec3 normal = glm::length(axis) > kNoDirection * count ? glm::normalize(axis) : rig.cameras[0].pose.forward();
  return plane_through(first + offset / count, normal);
}

}  // namespace lf
