// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/tour.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "view/navigator.h"
#include "view/view_path.h"

namespace lf {
namespace {

// Of a camera's field of view: what is left shows no border when the eye is between cameras.
constexpr double kFieldOfView = 0.85;

// A key of the tour. x, y: in halves of the array's extent; z: in distances at which the view, from the middle, just
// spans the array; focus: from near (0) to far (1), in the logarithm. |x| + |z| <= 1 keeps all lines of sight inside.
struct Key {
  double x, y, z, focus;
};
constexpr Key kKeys[] = {{0, 0, 0, 0},         {-0.6, -0.4, 0, 0}, {-0.35, 0.35, 0.35, 0.4}, {0.35, 0.35, 0.5, 1},
                         {0.55, -0.3, 0.2, 1}, {0, 0, -0.5, 1},    {-0.3, -0.2, -0.3, 0.4},  {0, 0, 0, 0}};
constexpr int kNumKeys = std::size(kKeys);

}  // namespace

std::vector<NamedView> make_tour(const Rig& rig, const FocusRange& focus, const TourOptions& options) {
  if (!(focus.near > 0 && focus.near <= focus.far && std::isfinite(focus.far)))
    throw Error("focus: must be 0 < near <= far, is " + std::to_string(focus.near) + " and " +
                std::to_string(focus.far));
  if (options.frames < 1) throw Error("frames: must be at least 1");
  if (!(options.rate_hz > 0)) throw Error("rate: must be positive");

  const Viewpoint home = default_viewpoint(rig);
  const Camera& middle = rig.cameras[middle_camera(rig)];
  const int width = options.width > 0 ? options.width : middle.width;
  const int height = options.height > 0 ? options.height : middle.height;
  // The tangent of half the angle decides what is seen: no wider than the camera in either direction.
  const double half_y = kFieldOfView * std::min(middle.height / 2.0 / middle.lens.fy(),
                                                middle.width / 2.0 / middle.lens.fx() * height / width);
  const double half_x = half_y * width / height;

  double extent_x = 0, extent_y = 0;
  for (const Camera& camera : rig.cameras) {
    const Vec3 from_middle = camera.pose.position - home.pose.position;
    extent_x = std::max(extent_x, std::abs(glm::dot(from_middle, home.pose.right())));
    extent_y = std::max(extent_y, std::abs(glm::dot(from_middle, home.pose.down())));
  }
  // Cameras on a line cover all of the other direction.
  const double tiny = 1e-3 * std::max(extent_x, extent_y);
  double reach = std::numeric_limits<double>::infinity();
  if (extent_x > tiny) reach = std::min(reach, extent_x / half_x);
  if (extent_y > tiny) reach = std::min(reach, extent_y / half_y);
  if (!std::isfinite(reach)) reach = 0;  // a single camera

  const double seconds = (options.frames - 1) / options.rate_hz;
  std::vector<NamedView> keys;
  for (int i = 0; i < (options.frames > 1 ? kNumKeys : 1); i++) {
    const Key& key = kKeys[i];
    Viewpoint v = home;
    // Never more than half-way to what is in focus, however large the array.
    const double forward = std::min(key.z * reach, focus.near / 2);
    v.pose.position +=
        key.x * extent_x * home.pose.right() + key.y * extent_y * home.pose.down() + forward * home.pose.forward();
    v.fov_y_deg = 2 * std::atan(half_y) * (180 / M_PI);
    v.focus_distance = focus.near * std::pow(focus.far / focus.near, key.focus) - forward;
    keys.push_back({"", seconds * i / (kNumKeys - 1), make_view(clamped(v), width, height)});
  }
  std::vector<NamedView> views = ViewPath(std::move(keys)).sample(options.rate_hz);
  if (options.still)
    for (NamedView& view : views) view.time = 0;
  return views;
}

}  // namespace lf
