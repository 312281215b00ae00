// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/view.h"

#include "base/error.h"
#include "rig/rig.h"

namespace lf {

void validate_size(const char* name, int pixels) {
  if (pixels < 1 || pixels > kMaxImageSize)
    throw Error(std::string(name) + ": must be 1 to " + std::to_string(kMaxImageSize) + " pixels, is " +
                std::to_string(pixels));
}

void validate(const View& view) {
  validate_size("width", view.width);
  validate_size("height", view.height);
  if (!is_finite(view.pose.position)) throw Error("position: must be finite numbers");
  if (!(std::abs(glm::length(view.pose.orientation) - 1) <= kUnitTolerance))
    throw Error("orientation: must be a quaternion of unit norm");
  validate(view.focus, view.width, view.height);
  validate(view.blending);
}

View seen_beside(const View& view, double metres) {
  View beside = view;
  beside.pose.position += metres * view.pose.right();
  return beside;
}

Plane focal_plane_at(const Pose& view_pose, double distance) {
  const Vec3 axis = view_pose.forward();
  return plane_through(view_pose.position + distance * axis, -axis);
}

}  // namespace lf
