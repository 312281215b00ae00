// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/point_cloud.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <optional>

#include "base/file.h"

namespace lf {
namespace {

// Returns true if the depths of a pixel and its neighbours belong to one surface. Requires known and finite depths.
bool is_inside(const DepthImage& image, int x, int y) {
  constexpr float kEdge = 0.05f;
  const auto at = [&](int column, int row) { return image.depths[static_cast<size_t>(row) * image.width + column]; };
  const float depth = at(x, y);
  const auto is_near = [&](int column, int row) {
    if (column < 0 || row < 0 || column >= image.width || row >= image.height) return true;
    return std::abs(at(column, row) - depth) <= kEdge * depth;
  };
  return depth > 0 && std::isfinite(depth) && is_near(x - 1, y) && is_near(x + 1, y) && is_near(x, y - 1) &&
         is_near(x, y + 1);
}

}  // namespace

std::vector<ColouredPoint> point_cloud(const View& view, const DepthImage& depths, const ImageView& rgb) {
  const Mat3 world_from_view = view.pose.rotation();
  std::vector<ColouredPoint> points;
  for (int y = 0; y < depths.height; y++)
    for (int x = 0; x < depths.width; x++) {
      if (!is_inside(depths, x, y)) continue;
      const std::optional<Vec2> ray = view.lens.unproject({x, y});
      if (!ray) continue;
      const double depth = depths.depths[static_cast<size_t>(y) * depths.width + x];
      const Vec3 point = view.pose.position + world_from_view * (depth * Vec3(*ray, 1));
      const uint8_t* const pixel = rgb.plane[0] + y * rgb.stride[0] + ptrdiff_t{x} * rgb.layout.pixel_stride;
      points.push_back({static_cast<float>(point.x), static_cast<float>(point.y), static_cast<float>(point.z),
                        pixel[rgb.layout.r], pixel[rgb.layout.g], pixel[rgb.layout.b]});
    }
  return points;
}

void save_ply(const std::vector<ColouredPoint>& points, const std::string& path) {
  static_assert(std::endian::native == std::endian::little);
  constexpr size_t kPosition = 3 * sizeof(float), kVertex = kPosition + 3;
  std::string bytes = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(points.size()) +
                      "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n"
                      "property uchar green\nproperty uchar blue\nend_header\n";
  const size_t header = bytes.size();
  bytes.resize(header + kVertex * points.size());
  char* to = bytes.data() + header;
  for (const ColouredPoint& point : points) {
    std::memcpy(to, &point.x, kPosition);
    std::memcpy(to + kPosition, &point.red, 3);
    to += kVertex;
  }
  AtomicFileWriter file(path);
  file.write(bytes);
  file.commit();
}

}  // namespace lf
