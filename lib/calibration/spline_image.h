// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "base/vec.h"
#include "image/image.h"

namespace lf {

// The luma of an RGB image as a smooth function of the place: the cubic B-spline through its pixels (Unser, "Splines: a
// perfect fit for signal and image processing", 1999). Bilinear interpolation is blunter half-way between pixels than
// on them, which pulls what is located by it towards them by hundredths of a pixel.
class SplineImage {
 public:
  explicit SplineImage(const Image& rgb);

  // Whether the four pixels to each side that a sample needs are there.
  bool has(double x, double y) const { return x >= 1 && y >= 1 && x < width_ - 2 && y < height_ - 2; }
  // Only where has(x, y).
  float value(double x, double y) const;
  struct Sample {
    float value, dx, dy;
  };
  Sample sample(double x, double y) const;

 private:
  int width_, height_;
  std::vector<float> coefficients_;
};

}  // namespace lf
