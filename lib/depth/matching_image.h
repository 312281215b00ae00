// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "geometry/pose.h"
#include "image/image.h"
#include "rig/rig.h"

namespace lf {

// A camera image as stereo matching uses it: reduced, without lens distortion, and with the derivatives of luma. The
// lens is a pinhole with square pixels. (0, 0) is the centre of the top-left pixel.
struct MatchingImage {
  static constexpr int kUnit = 64;  // one level of luma
  // In kUnit-ths of a level: luma, and its central differences along x and y per pixel. The last value is 0 if the
  // camera sees the pixel and those beside it, otherwise kUnseen.
  using Pixel = std::array<int16_t, 4>;
  static constexpr int16_t kUnseen = 16384;

  int width = 0, height = 0;
  double focal = 0;  // pixels
  Vec2 centre{0, 0};
  Pose pose;                  // world_from_camera
  std::vector<Pixel> pixels;  // row by row

  size_t size() const { return pixels.size(); }
  // Returns the point with Z = 1 in camera coordinates on the line of sight of a pixel.
  Vec3 ray(double x, double y) const { return {(x - centre.x) / focal, (y - centre.y) / focal, 1}; }
};

// Reduces the image of a camera by `divisor` (at least 1) in each direction, averaging divisor x divisor samples for
// each pixel. `image` must have the camera's size and must be in memory. The result has at least one pixel.
MatchingImage matching_image(const Camera& camera, const ImageView& image, int divisor);

// Maps pixels of one image with known depth into another image: a pixel (x, y) at the inverse depth d (1/Z, in 1/m)
// falls on (p.x / p.z, p.y / p.z) with p = at(x, y) + d * parallax. The depth of the point in
// the other camera is p.z / d. A point with p.z <= 0 is behind this camera.
struct PixelMapping {
  std::array<std::array<float, 3>, 3> rows;  // at(x, y) = rows * (x, y, 1)
  std::array<float, 3> parallax;

  PixelMapping(const MatchingImage& from, const MatchingImage& to);
  std::array<float, 3> at(float x, float y) const {
    return {rows[0][0] * x + rows[0][1] * y + rows[0][2], rows[1][0] * x + rows[1][1] * y + rows[1][2],
            rows[2][0] * x + rows[2][1] * y + rows[2][2]};
  }
};

}  // namespace lf
