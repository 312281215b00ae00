// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cmath>
#include <vector>

#include "base/maths.h"
#include "composite/accumulator.h"
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

// Compares two RGB pictures of one size (else Error). `coverage`: width * height values 0..1, or empty: all pixels
// count. SSIM: Wang et al. 2004, eq. 13: 11x11 Gaussian of sigma 1.5, K1 = 0.01, K2 = 0.03, L = 255, on full-range
// BT.601 luma, windows cut off at the border are renormalised. If nothing is covered all figures are NaN and coverage
// is 0.
Quality compare(const Image& picture, const Image& truth, const std::vector<float>& coverage = {});

// How far each pixel is from its ground truth: the root of the mean square of its channels' differences, 0..255; NaN
// where it is not counted. Pictures and `coverage` as for compare(), whose PSNR follows from the mean square of these.
std::vector<float> differences(const Image& picture, const Image& truth, const std::vector<float>& coverage = {});

// A picture, and how far each of its pixels can be relied upon.
struct CoveredPicture {
  Image rgb;
  std::vector<float> coverage;  // 0..1: how much of their weight cameras could give
};
// `sum`: all of a picture, with what is uncovered marked.
CoveredPicture covered_picture(const Accumulator& sum);

// How what a camera sees differs from what other cameras predict of it.
struct PredictionError {
  double psnr_db = 0;  // see Quality
  double gain = 1;     // luma seen = gain x luma predicted
  Vec2 shift{0, 0};    // what is predicted at x is seen at x + shift; pixels of the pictures
  // How far parts of the picture differ from that, the median of them: much where they are out of focus, and what is
  // near is seen elsewhere than what is far.
  double gain_scatter = 0, shift_scatter = 0;
};
inline constexpr PredictionError kNotPredicted{NAN, NAN, {NAN, NAN}, NAN, NAN};

// Compares two RGB pictures of one size (else Error). Counted are pixels of which the prediction has at least kCovered
// of the weight. Gain and shift are those that bring the two together best: Lucas and Kanade's (1981) with a gain,
// robust (Cauchy), since what is out of focus or hidden agrees with neither. They do not need neighbouring pixels to be
// neighbours in the camera: every fourth will do, as long as the shift is a few of them at most. kNotPredicted where
// less than a quarter is covered, or nothing tells a shift.
PredictionError compare_prediction(const Image& predicted, const Image& seen, const std::vector<float>& coverage);
PredictionError compare_prediction(const CoveredPicture& predicted, const CoveredPicture& seen);

}  // namespace lf
