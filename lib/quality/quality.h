// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "image/image.h"

namespace lf {

// How near a picture is to its ground truth.
struct Quality {
  double psnr_db = 0;   // over the three colour channels of the pixels counted; +infinity if equal
  double ssim = 0;      // mean over the pixels counted of SSIM of luma; 1 if equal
  int max_error = 0;    // largest channel difference, 0..255
  double coverage = 0;  // fraction of pixels counted, 0..1
};

inline constexpr float kCovered = 0.999f;  // pixels with coverage above this are counted

// Both RGB and of one size (else Error). `coverage`: width * height values 0..1, or empty: all pixels count.
// SSIM: Wang et al. 2004, eq. 13: 11x11 Gaussian of sigma 1.5, K1 = 0.01, K2 = 0.03, L = 255, on full-range BT.601
// luma, windows cut off at the border are renormalised. If nothing is covered all figures are NaN and coverage is 0.
Quality compare(const Image& picture, const Image& truth, const std::vector<float>& coverage = {});

// Absolute difference of the two (largest channel) times `gain`, as grey RGB.
Image error_map(const Image& picture, const Image& truth, double gain = 4);

}  // namespace lf
