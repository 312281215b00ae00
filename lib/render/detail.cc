// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/detail.h"

#include <cmath>

namespace lf {

bool is_pixel_for_pixel(const View& view, const Camera& camera) {
  constexpr double kSame = 1.0 / 16;  // of a pixel
  const double offset = glm::length(camera.pose.position - view.pose.position);
  const double distance = std::abs(view.focus.plane.signed_distance(view.pose.position));
  if (!(offset * camera.lens.fy() <= kSame * distance)) return false;
  // The same shift by whole pixels in the middle and in the corners.
  const Vec2 middle(std::floor((view.width - 1) / 2.0), std::floor((view.height - 1) / 2.0));
  const Vec2 last(view.width - 1, view.height - 1);
  std::optional<Vec2> shift;
  for (const Vec2& pixel : {middle, Vec2(0, 0), Vec2(last.x, 0), Vec2(0, last.y), last}) {
    const std::optional<Vec2> ray = view.lens.unproject(pixel);
    if (!ray) return false;
    const Vec3 direction = view.pose.rotation() * Vec3(*ray, 1);
    const std::optional<Vec2> at = camera.lens.project(glm::transpose(camera.pose.rotation()) * direction);
    if (!at) return false;
    if (!shift) shift = Vec2(std::round(at->x - pixel.x), std::round(at->y - pixel.y));
    if (glm::length(*at - pixel - *shift) > kSame) return false;
  }
  return true;
}

}  // namespace lf
