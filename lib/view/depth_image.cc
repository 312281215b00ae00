// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/depth_image.h"

#include <optional>

namespace lf {

DepthImage depth_image(const View& view, std::span<const float> coverage) {
  DepthImage image{view.width, view.height, {}};
  image.depths.assign(static_cast<size_t>(view.width) * view.height, 0);
  const FocalMap* const map = view.focus.map.get();
  const Plane& plane = map ? map->from : view.focus.plane;
  // The points of a line of sight at depth t are eye + t (world_from_view * ray). Depths are measured from the plane.
  const double eye = plane.signed_distance(view.pose.position);
  const Vec3 normal = glm::transpose(view.pose.rotation()) * plane.normal;
  std::vector<float> inverse(static_cast<size_t>(view.width));
  for (int y = 0; y < view.height; y++) {
    if (map) map->inverse_row(0, 1, y, view.width, inverse.data());
    for (int x = 0; x < view.width; x++) {
      const size_t i = static_cast<size_t>(y) * view.width + x;
      if (!coverage.empty() && !(coverage[i] > 0)) continue;
      const std::optional<Vec2> at = view.lens.unproject({x, y});
      if (!at) continue;
      const double distance = map ? 1 / static_cast<double>(inverse[static_cast<size_t>(x)]) : 0;
      const auto depth = static_cast<float>((distance - eye) / glm::dot(normal, Vec3(*at, 1)));
      if (depth > 0) image.depths[i] = depth;
    }
  }
  return image;
}

}  // namespace lf
