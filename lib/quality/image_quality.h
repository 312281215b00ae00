// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cmath>
#include <vector>

#include "base/maths.h"
#include "composite/accumulator.h"
#include "image/image.h"

namespace lf {

struct Quality {
  double psnr_db = 0;   // over all colour channels of the counted pixels; +infinity if equal
  double ssim = 0;      // mean SSIM of luma over the counted pixels; 1 if equal
  int max_error = 0;    // largest channel difference, 0..255
  double coverage = 0;  // fraction of counted pixels, 0..1
};

inline constexpr float kMinCoverage = 0.999f;  // pixels with more coverage are counted

// Compares two RGB pictures. `coverage` contains width * height values 0..1; if it is empty, all pixels count. Throws
// Error if the sizes differ. If no pixel is covered, coverage is 0, and PSNR and SSIM are NaN. SSIM follows Wang et al.
// 2004, eq. 13, with an 11x11 Gaussian window of sigma 1.5, K1 = 0.01, K2 = 0.03 and L = 255, on full-range BT.601
// luma. Windows that the border truncates are renormalised.
Quality compare(const Image& picture, const Image& truth, const std::vector<float>& coverage = {});

// Returns the RMS difference over the channels of each pixel, 0..255, or NaN for pixels that are not counted. The PSNR
// of compare() follows from the mean of the squared values. The arguments are as for compare().
std::vector<float> differences(const Image& picture, const Image& truth, const std::vector<float>& coverage = {});

struct CoverageImage {
  Image rgb;
  std::vector<float> coverage;  // fraction of the camera weights that is available, 0..1
};
// Returns the coverage of a finished picture. `sum` must be a whole picture, with uncovered pixels marked.
CoverageImage coverage_image(const Accumulator& sum);

struct PredictionError {
  double psnr_db = 0;
  double gain = 1;   // luma seen = gain x luma predicted
  Vec2 shift{0, 0};  // pixel x of the prediction is seen at x + shift
  // Median deviation of parts of the picture from the whole. It is large if parts are out of focus, because near and
  // far objects then shift differently.
  double gain_scatter = 0, shift_scatter = 0;
};
inline constexpr PredictionError kNoPrediction{NAN, NAN, {NAN, NAN}, NAN, NAN};

// Compares an image with its prediction. The pictures must be RGB. Throws Error if the sizes differ. Only pixels with a
// coverage above kMinCoverage count. Gain and shift are the best fit of Lucas and Kanade (1981), extended by a gain.
// Cauchy weights make the fit robust to pixels that are out of focus or hidden. The pixels may be subsampled, as long
// as the shift is at most a few pixels. Returns kNoPrediction if less than a quarter is covered or the shift is
// undetermined.
PredictionError compare_prediction(const Image& predicted, const Image& seen, const std::vector<float>& coverage);
PredictionError compare_prediction(const CoverageImage& predicted, const CoverageImage& seen);

}  // namespace lf
