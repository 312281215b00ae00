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
