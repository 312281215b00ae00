// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "base/vec.h"
#include "image/image.h"

// Samples of cameras' images one by one, where SIMD would not pay.
namespace lf::plain {

// Sampling of one 8-bit channel, bilinear or by Catmull-Rom; coordinates are clamped to the outer pixel centres, and
// the outer pixels go on beyond.
class Sampler {
 public:
  Sampler(const Vec2& position, int width, int height, Resampling resampling)
      : taps_(resampling == Resampling::kCatmullRom ? 4 : 2),
        across_(position.x, width, taps_),
        down_(position.y, height, taps_) {}
  float sample(const uint8_t* plane, ptrdiff_t stride, int pixel_stride) const {
    const auto value = [&](int i, int j) {
      return static_cast<float>(plane[down_.at[j] * stride + across_.at[i] * pixel_stride]);
    };
    if (taps_ == 2) {
      const float upper = value(0, 0) + (value(1, 0) - value(0, 0)) * across_.weight[1];
      const float lower = value(0, 1) + (value(1, 1) - value(0, 1)) * across_.weight[1];
      return upper + (lower - upper) * down_.weight[1];
    }
    float sum = 0;
    for (int j = 0; j < taps_; j++) {
      float along = 0;
      for (int i = 0; i < taps_; i++) along += across_.weight[i] * value(i, j);
      sum += down_.weight[j] * along;
    }
    return std::clamp(sum, 0.f, 255.f);
  }

 private:
  struct Axis {
    Axis(double position, int size, int taps) {
      const double x = std::clamp(position, 0.0, size - 1.0);
      const int first = static_cast<int>(x) - (taps / 2 - 1);
      const auto t = static_cast<float>(x - static_cast<int>(x));
      for (int i = 0; i < taps; i++) at[i] = std::clamp(first + i, 0, size - 1);
      if (taps == 2) {
        weight[1] = t;
      } else {
        const float near = t * (1 - t) * (1 - t), far = t * t * (1 - t);
        weight[0] = -near / 2;
        weight[1] = 1 - t + near - far / 2;
        weight[2] = t + far - near / 2;
        weight[3] = -far / 2;
      }
    }
    int at[4];
    float weight[4];
  };
  int taps_;
  Axis across_, down_;
};

}  // namespace lf::plain
