// SPDX-License-Identifier: LGPL-2.1-or-later
#include "geometry/pose.h"

namespace lf {

Pose look_at(const Vec3& eye, const Vec3& target, const Vec3& down) {
  const Vec3 z = glm::normalize(target - eye);
  const Vec3 x = glm::normalize(glm::cross(down, z));
  const Vec3 y = glm::cross(z, x);
  return {eye, glm::normalize(glm::quat_cast(Mat3(x, y, z)))};
}

}  // namespace lf
