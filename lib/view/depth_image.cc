// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/depth_image.h"

#include <optional>

namespace lf {

namespace {

// Computes depths of one view. The points of a line of sight at depth t are eye + t (world_from_view * ray). Depths are
// measured from the plane of the map, or are on the focal plane.
class SurfaceDepth {
 public:
  explicit SurfaceDepth(const View& view) : view_(view) {
    const Plane& plane = view.focus.map ? view.focus.map->from : view.focus.plane;
    eye_ = plane.signed_distance(view.pose.position);
    normal_ = glm::transpose(view.pose.rotation()) * plane.normal;
  }
  // `inverse` is the inverse distance of the map at the position.
  float at(const Vec2& pixel, double inverse) const {
    const std::optional<Vec2> ray = view_.lens.unproject(pixel);
    if (!ray) return 0;
    const double distance = view_.focus.map ? 1 / inverse : 0;
    const auto depth = static_cast<float>((distance - eye_) / glm::dot(normal_, Vec3(*ray, 1)));
    return depth > 0 ? depth : 0;
  }

 private:
  const View& view_;
  double eye_ = 0;
  Vec3 normal_;
};

}  // namespace

float depth_at(const View& view, const Vec2& at) {
  return SurfaceDepth(view).at(at, view.focus.map ? view.focus.map->inverse_at(at.x, at.y) : 0);
}

DepthImage depth_image(const View& view, std::span<const float> coverage) {
  DepthImage image{view.width, view.height, {}};
  image.depths.assign(static_cast<size_t>(view.width) * view.height, 0);
  const FocalMap* const map = view.focus.map.get();
  const SurfaceDepth depth(view);
  std::vector<float> inverse(static_cast<size_t>(view.width));
  for (int y = 0; y < view.height; y++) {
    if (map) map->inverse_row(0, 1, y, view.width, inverse.data());
    for (int x = 0; x < view.width; x++) {
      const size_t i = static_cast<size_t>(y) * view.width + x;
      if (coverage.empty() || coverage[i] > 0) image.depths[i] = depth.at({x, y}, inverse[static_cast<size_t>(x)]);
    }
  }
  return image;
}

}  // namespace lf
