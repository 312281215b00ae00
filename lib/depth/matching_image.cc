// SPDX-License-Identifier: LGPL-2.1-or-later
#include "depth/matching_image.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace lf {

namespace {

// Returns the luma of BT.601 at (x, y), interpolated bilinearly, or NaN outside of the pixels' centres.
double luma_at(const ImageView& image, double x, double y) {
  if (!(x >= 0 && y >= 0 && x <= image.width - 1 && y <= image.height - 1))
    return std::numeric_limits<double>::quiet_NaN();
  const int x0 = std::min(static_cast<int>(x), std::max(image.width - 2, 0));
  const int y0 = std::min(static_cast<int>(y), std::max(image.height - 2, 0));
  const auto at = [&](int i, int j) -> double {
    const uint8_t* const row = image.plane[0] + image.stride[0] * std::min(j, image.height - 1);
    i = std::min(i, image.width - 1);
    if (image.family == PixelFamily::kI420) return row[i];
    const uint8_t* const pixel = row + static_cast<ptrdiff_t>(i) * image.layout.pixel_stride;
    return 0.299 * pixel[image.layout.r] + 0.587 * pixel[image.layout.g] + 0.114 * pixel[image.layout.b];
  };
  const double right = x - x0, down = y - y0;
  const double upper = at(x0, y0) + right * (at(x0 + 1, y0) - at(x0, y0));
  const double lower = at(x0, y0 + 1) + right * (at(x0 + 1, y0 + 1) - at(x0, y0 + 1));
  return upper + down * (lower - upper);
}

// Returns the pixels for their luma. NaN: the camera does not see the pixel.
std::vector<MatchingImage::Pixel> pixels_of(const std::vector<double>& luma, int width, int height) {
  const auto in_units = [](double levels) { return static_cast<int16_t>(std::lround(MatchingImage::kUnit * levels)); };
  std::vector<MatchingImage::Pixel> pixels;
  pixels.reserve(luma.size());
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++) {
      const auto at = [&](int i, int j) {
        return luma[static_cast<size_t>(std::clamp(j, 0, height - 1)) * width + std::clamp(i, 0, width - 1)];
      };
      const double dx = (at(x + 1, y) - at(x - 1, y)) / 2, dy = (at(x, y + 1) - at(x, y - 1)) / 2;
      if (std::isnan(at(x, y)) || std::isnan(dx) || std::isnan(dy))
        pixels.push_back({0, 0, 0, MatchingImage::kUnseen});
      else
        pixels.push_back({in_units(at(x, y)), in_units(dx), in_units(dy), 0});
    }
  return pixels;
}

}  // namespace

MatchingImage matching_image(const Camera& camera, const ImageView& image, int divisor) {
  const Lens& lens = camera.lens;
  MatchingImage out;
  out.width = std::max(camera.width / divisor, 1);
  out.height = std::max(camera.height / divisor, 1);
  out.pose = camera.pose;
  out.focal = std::sqrt(lens.fx() * lens.fy()) / divisor;
  const double to_centre = (divisor - 1) / 2.0;  // from the first of the averaged samples to the pixel's centre
  out.centre = {(lens.cx() - to_centre) / divisor, (lens.cy() - to_centre) / divisor};
  std::vector<double> luma;
  luma.reserve(static_cast<size_t>(out.width) * out.height);
  for (int y = 0; y < out.height; y++)
    for (int x = 0; x < out.width; x++) {
      double sum = 0;
      for (int j = 0; j < divisor; j++)
        for (int i = 0; i < divisor; i++) {
          const Vec3 ray = out.ray(x + (i - to_centre) / divisor, y + (j - to_centre) / divisor);
          const std::optional<Vec2> at = lens.project(ray);
          sum += at ? luma_at(image, at->x, at->y) : std::numeric_limits<double>::quiet_NaN();
        }
      luma.push_back(sum / (divisor * divisor));
    }
  out.pixels = pixels_of(luma, out.width, out.height);
  return out;
}

PixelMapping::PixelMapping(const MatchingImage& from, const MatchingImage& to) {
  // A point at depth Z has p / d = K (R ray Z + t) for d = 1 / Z, so p = K R ray + d K t.
  const Mat3 world_to = glm::transpose(to.pose.rotation());
  const Mat3 turn = world_to * from.pose.rotation();
  const Vec3 shift = world_to * (from.pose.position - to.pose.position);
  const auto project = [&](const Vec3& v) {
    return Vec3(to.focal * v.x + to.centre.x * v.z, to.focal * v.y + to.centre.y * v.z, v.z);
  };
  const Vec3 along_x = project(turn[0]) / from.focal, along_y = project(turn[1]) / from.focal;
  const Vec3 origin = project(turn[2]) - from.centre.x * along_x - from.centre.y * along_y, t = project(shift);
  for (int i = 0; i < 3; i++) {
    rows[i] = {static_cast<float>(along_x[i]), static_cast<float>(along_y[i]), static_cast<float>(origin[i])};
    parallax[i] = static_cast<float>(t[i]);
  }
}

}  // namespace lf
