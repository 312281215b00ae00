// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/view.h"

#include <string>

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

Blending blending_of(double aperture, int nearest) {
  if (aperture != 0) return {Blending::Kind::kAperture, aperture, 0};
  if (nearest != 0) return {Blending::Kind::kAngle, 0, nearest};
  return {};
}

void validate(const Blending& blending) {
  const bool wide = blending.kind == Blending::Kind::kAperture, by_angle = blending.kind == Blending::Kind::kAngle;
  if (wide ? !(blending.aperture > 0 && blending.aperture <= Blending::kMaxAperture) : blending.aperture != 0)
    throw Error(wide ? "blending: the aperture must be above 0, at most 1000000 m"
                     : "blending: has an aperture that its kind does not know");
  if (by_angle ? !(blending.nearest >= 1 && blending.nearest <= Blending::kMaxNearest) : blending.nearest != 0)
    throw Error(by_angle ? "blending: must be of the nearest 1 to " + std::to_string(Blending::kMaxNearest) + " cameras"
                         : "blending: has a number of cameras that its kind does not know");
}

}  // namespace lf
