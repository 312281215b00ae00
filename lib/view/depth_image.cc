// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/depth_image.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>

#include <opencv2/imgcodecs.hpp>

#include "base/file.h"
#include "base/text.h"

namespace lf {
namespace {

// Returns the depth of the focal surface on a line of sight. `ray` is in coordinates of the view, with z = 1.
double depth_on(const View& view, const Mat3& world_from_view, const Vec3& ray, double x, double y) {
  const FocalMap* const map = view.focus.map.get();
  // The points of the line at depth t are eye + t direction.
  const Vec3 direction = world_from_view * ray;
  const Plane& plane = map ? map->from : view.focus.plane;
  const double distance = map ? 1 / map->inverse_at(x, y) : 0;  // from the plane
  return (distance - plane.signed_distance(view.pose.position)) / glm::dot(plane.normal, direction);
}

}  // namespace

DepthImage depth_image(const View& view, std::span<const float> coverage) {
  DepthImage image{view.width, view.height, {}};
  image.depths.assign(static_cast<size_t>(view.width) * view.height, 0);
  const Mat3 world_from_view = view.pose.rotation();
  for (int y = 0; y < view.height; y++)
    for (int x = 0; x < view.width; x++) {
      const size_t i = static_cast<size_t>(y) * view.width + x;
      if (!coverage.empty() && !(coverage[i] > 0)) continue;
      const std::optional<Vec2> at = view.lens.unproject({x, y});
      if (!at) continue;
      const auto depth = static_cast<float>(depth_on(view, world_from_view, Vec3(*at, 1), x, y));
      if (depth > 0) image.depths[i] = depth;
    }
  return image;
}

void save_depth_pfm(const DepthImage& image, const std::string& path) {
  static_assert(std::endian::native == std::endian::little);
  AtomicFileWriter file(path);
  file.write("Pf\n" + std::to_string(image.width) + " " + std::to_string(image.height) + "\n-1\n");  // little-endian
  for (int y = image.height - 1; y >= 0; y--)
    file.write({reinterpret_cast<const char*>(image.depths.data() + static_cast<size_t>(y) * image.width),
                static_cast<size_t>(image.width) * sizeof(float)});
  file.commit();
}

void save_depth_png(const DepthImage& image, const std::string& path) {
  constexpr float kMillimetres = 1000;
  cv::Mat pixels(image.height, image.width, CV_16UC1);
  std::ranges::transform(image.depths, pixels.begin<uint16_t>(), [](float depth) {
    return static_cast<uint16_t>(std::lround(std::min(depth * kMillimetres, 65535.0f)));
  });
  std::vector<uint8_t> bytes;
  try {
    cv::imencode(".png", pixels, bytes);
  } catch (const cv::Exception& error) {
    throw Error(path + ": " + error.what());
  }
  AtomicFileWriter file(path);
  file.write({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  file.commit();
}

}  // namespace lf
