// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "base/vec.h"
#include "image/image.h"

// Samples of cameras' images one by one, where SIMD would not pay.
namespace lf::plain {

// A bilinear sample of one 8-bit channel; coordinates are clamped to the outer pixel centres.
class Sampler {
 public:
  Sampler(const Vec2& position, int width, int height) : across_(position.x, width), down_(position.y, height) {}
  float sample(const uint8_t* plane, ptrdiff_t stride, int pixel_stride) const {
    const auto value = [&](int x, int y) { return static_cast<float>(plane[y * stride + x * pixel_stride]); };
    const auto along = [&](int y) {
      const float left = value(across_.first, y);
      return left + (value(across_.second, y) - left) * across_.weight;
    };
    const float upper = along(down_.first);
    return upper + (along(down_.second) - upper) * down_.weight;
  }

 private:
  struct Axis {
    Axis(double position, int size) {
      const double x = std::clamp(position, 0.0, size - 1.0);
      first = static_cast<int>(x);
      second = std::min(first + 1, size - 1);
      weight = static_cast<float>(x - first);
    }
    int first, second;
    float weight;  // of the second
  };
  Axis across_, down_;
};

}  // namespace lf::plain
