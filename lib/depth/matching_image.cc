// SPDX-License-Identifier: LGPL-2.1-or-later
#include "depth/matching_image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

namespace lf {

namespace {

constexpr double kUnseen = std::numeric_limits<double>::quiet_NaN();  // luma outside of an image

// A position between two rows or columns of an image.
struct Position {
  int first = 0, second = 0;
  // The weight of the second row or column; kUnseen outside of the image.
  double part = kUnseen;
};

Position position_of(double at, int size) {
  if (!(at >= 0 && at <= size - 1)) return {};
  const int first = std::min(static_cast<int>(at), std::max(size - 2, 0));
  return {first, std::min(first + 1, size - 1), static_cast<double>(at - first)};
}

// The luma of BT.601 of an image.
class LumaImage {
 public:
  explicit LumaImage(const ImageView& image) : width_(image.width), height_(image.height) {
    luma_.resize(static_cast<size_t>(width_) * height_);
    for (int y = 0; y < height_; y++) {
      const uint8_t* const row = image.plane[0] + image.stride[0] * y;
      double* const out = &luma_[static_cast<size_t>(y) * width_];
      if (image.family == PixelFamily::kI420) {
        std::copy_n(row, width_, out);
        continue;
      }
      const auto [r, g, b] = std::array{row + image.layout.r, row + image.layout.g, row + image.layout.b};
      const auto stride = static_cast<ptrdiff_t>(image.layout.pixel_stride);
      for (int x = 0; x < width_; x++) out[x] = 0.299 * r[x * stride] + 0.587 * g[x * stride] + 0.114 * b[x * stride];
    }
  }

  // Returns the luma at a position, interpolated bilinearly.
  double at(const Vec2& position) const {
    const Position x = position_of(position.x, width_), y = position_of(position.y, height_);
    const double *const upper = row(y.first), *const lower = row(y.second);
    return blend(blend(upper[x.first], upper[x.second], x.part), blend(lower[x.first], lower[x.second], x.part),
                 y.part);
  }
  // Writes the luma between two rows.
  void write_row(const Position& y, double* out) const {
    const double *const upper = row(y.first), *const lower = row(y.second);
    for (int x = 0; x < width_; x++) out[x] = blend(upper[x], lower[x], y.part);
  }
  static double blend(double a, double b, double part) { return a + part * (b - a); }
  int width() const { return width_; }
  int height() const { return height_; }

 private:
  const double* row(int y) const { return &luma_[static_cast<size_t>(y) * width_]; }

  const int width_, height_;
  std::vector<double> luma_;
};

// Returns the luma of each pixel of `out`, the mean of divisor x divisor samples. kUnseen: the camera does not see all
// of the pixel.
std::vector<double> reduced_luma(const Lens& lens, const LumaImage& image, int divisor, const MatchingImage& out) {
  const double to_centre = (divisor - 1) / 2.0;  // distance from the first sample to the pixel's centre
  const auto offset_of = [&](int sample) { return sample / divisor + (sample % divisor - to_centre) / divisor; };
  std::vector<double> sums(static_cast<size_t>(out.width) * out.height);
  if (lens.has_distortion()) {
    for (int y = 0; y < divisor * out.height; y++)
      for (int x = 0; x < divisor * out.width; x++) {
        const std::optional<Vec2> at = lens.project(out.ray(offset_of(x), offset_of(y)));
        sums[static_cast<size_t>(y / divisor) * out.width + x / divisor] += at ? image.at(*at) : kUnseen;
      }
  } else {
    std::vector<Position> columns;
    for (int x = 0; x < divisor * out.width; x++)
      columns.push_back(position_of(lens.fx() * out.ray(offset_of(x), 0).x + lens.cx(), image.width()));
    std::vector<double> row(image.width());
    for (int y = 0; y < divisor * out.height; y++) {
      image.write_row(position_of(lens.fy() * out.ray(0, offset_of(y)).y + lens.cy(), image.height()), row.data());
      double* const sum = &sums[static_cast<size_t>(y / divisor) * out.width];
      for (int x = 0; x < divisor * out.width; x++)
        sum[x / divisor] += LumaImage::blend(row[columns[x].first], row[columns[x].second], columns[x].part);
    }
  }
  for (double& sum : sums) sum /= static_cast<double>(divisor * divisor);
  return sums;
}

// Returns the pixels for their luma.
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
  out.pixels = pixels_of(reduced_luma(lens, LumaImage(image), divisor, out), out.width, out.height);
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
