// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/spline_image.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

namespace lf {
namespace {

// The filter that makes a spline pass through its samples, forth and back over one row or column.
void prefilter(float* p, int count, int stride) {
  const float pole = std::sqrt(3.0f) - 2;
  constexpr int kReach = 12;  // pole^12 is 1e-7
  float sum = 0, weight = 1;
  for (int k = 0; k < std::min(count, kReach); k++, weight *= pole) sum += weight * p[k * stride];
  p[0] = 6 * sum;
  for (int k = 1; k < count; k++) p[k * stride] = 6 * p[k * stride] + pole * p[(k - 1) * stride];
  float& last = p[(count - 1) * stride];
  last = pole / (pole * pole - 1) * (last + pole * p[std::max(count - 2, 0) * stride]);
  for (int k = count - 2; k >= 0; k--) p[k * stride] = pole * (p[(k + 1) * stride] - p[k * stride]);
}

struct Weights {
  float w[4];
};

Weights weights(float t) {
  const float u = 1 - t;
  return {{u * u * u / 6, (3 * t * t * t - 6 * t * t + 4) / 6, (3 * u * u * u - 6 * u * u + 4) / 6, t * t * t / 6}};
}

Weights slopes(float t) {
  const float u = 1 - t;
  return {{-u * u / 2, (3 * t * t - 4 * t) / 2, -(3 * u * u - 4 * u) / 2, t * t / 2}};
}

float dot(const Weights& a, const float* p) { return a.w[0] * p[0] + a.w[1] * p[1] + a.w[2] * p[2] + a.w[3] * p[3]; }

}  // namespace

SplineImage::SplineImage(const Image& rgb)
    : width_(rgb.width()), height_(rgb.height()), coefficients_(static_cast<size_t>(width_) * height_) {
  const cv::Mat image(height_, width_, CV_8UC3, const_cast<uint8_t*>(rgb.data().data()));
  cv::Mat grey, smooth(height_, width_, CV_32F, coefficients_.data());
  cv::cvtColor(image, grey, cv::COLOR_RGB2GRAY);
  grey.convertTo(smooth, CV_32F);
  for (int y = 0; y < height_; y++) prefilter(coefficients_.data() + static_cast<size_t>(y) * width_, width_, 1);
  for (int x = 0; x < width_; x++) prefilter(coefficients_.data() + x, height_, width_);
}

float SplineImage::value(double x, double y) const {
  const int left = static_cast<int>(x), top = static_cast<int>(y);
  const Weights across = weights(static_cast<float>(x - left)), down = weights(static_cast<float>(y - top));
  float sum = 0;
  for (int j = 0; j < 4; j++)
    sum += down.w[j] * dot(across, &coefficients_[static_cast<size_t>(top - 1 + j) * width_ + left - 1]);
  return sum;
}

SplineImage::Sample SplineImage::sample(double x, double y) const {
  const int left = static_cast<int>(x), top = static_cast<int>(y);
  const auto fx = static_cast<float>(x - left), fy = static_cast<float>(y - top);
  const Weights across = weights(fx), down = weights(fy), slope_across = slopes(fx), slope_down = slopes(fy);
  Sample s{0, 0, 0};
  for (int j = 0; j < 4; j++) {
    const float* row = &coefficients_[static_cast<size_t>(top - 1 + j) * width_ + left - 1];
    const float value = dot(across, row);
    s.value += down.w[j] * value;
    s.dx += down.w[j] * dot(slope_across, row);
    s.dy += slope_down.w[j] * value;
  }
  return s;
}

}  // namespace lf
