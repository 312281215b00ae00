// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/patch.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <opencv2/imgproc.hpp>

namespace lf {
namespace {

constexpr double kSoftEdge = 6;          // pixels: sigma of the weights
constexpr float kLeastContrast = 2;      // grey levels: below it is noise
constexpr int kMostSteps = 12;           // most need four
constexpr float kSmallStep = 2e-3;       // pixels
constexpr double kFarthest = 2;          // pixels from the guess
constexpr double kMostWarp = 0.6;        // of the identity
constexpr double kLeastScale = 0.2;      // of the area: a patch does not shrink to nothing in a step
constexpr float kLeastCondition = 1e-4;  // of the information: an edge does not tell its place along itself

}  // namespace

const Patch::Values& Patch::weights() {
  static const Values values = [] {
    Values w;
    int k = 0;
    for (int y = -kRadius; y <= kRadius; y++)
      for (int x = -kRadius; x <= kRadius; x++, k++)
        w[k] = static_cast<float>(std::exp(-(x * x + y * y) / (2 * kSoftEdge * kSoftEdge)));
    return Values(w / w.sum());
  }();
  return values;
}

bool Patch::normalise(Values& values) {
  values.array() -= weights().dot(values);
  const float contrast = std::sqrt(weights().dot(values.cwiseAbs2()));
  if (!(contrast > kLeastContrast)) return false;
  values /= contrast;
  return true;
}

std::optional<Patch> Patch::cut(const SplineImage& image, const Vec2& point) {
  if (!image.has(point.x - kRadius, point.y - kRadius) || !image.has(point.x + kRadius, point.y + kRadius))
    return std::nullopt;
  Patch patch;
  Eigen::Matrix<float, kSize, kTerms> slopes;  // by a step
  int k = 0;
  for (int y = -kRadius; y <= kRadius; y++)
    for (int x = -kRadius; x <= kRadius; x++, k++) {
      const SplineImage::Sample s = image.sample(point.x + x, point.y + y);
      const auto u = static_cast<float>(x) / kRadius, v = static_cast<float>(y) / kRadius;
      patch.values_[k] = s.value;
      slopes.row(k) << s.dx, s.dy, s.dx * u, s.dx * v, s.dy * u, s.dy * v;
    }
  const Values original = patch.values_;
  if (!normalise(patch.values_)) return std::nullopt;
  // What changes brightness or contrast alone tells nothing of a step.
  const float contrast = weights().cwiseProduct(original).dot(patch.values_);
  slopes /= contrast;
  const Eigen::Matrix<float, 1, kTerms> brightness = weights().transpose() * slopes;
  slopes.rowwise() -= brightness;
  const Eigen::Matrix<float, 1, kTerms> same = weights().cwiseProduct(patch.values_).transpose() * slopes;
  slopes -= patch.values_ * same;
  const Eigen::Matrix<float, kTerms, kTerms> information = slopes.transpose() * weights().asDiagonal() * slopes;
  const Eigen::LDLT<Eigen::Matrix<float, kTerms, kTerms>> ldlt(information);
  if (!(ldlt.vectorD().minCoeff() > kLeastCondition * ldlt.vectorD().maxCoeff())) return std::nullopt;
  patch.step_ = ldlt.solve(slopes.transpose() * weights().asDiagonal());
  return patch;
}

std::optional<Patch::Match> Patch::find(const SplineImage& image, const Vec2& guess) const {
  Eigen::Matrix2d warp = Eigen::Matrix2d::Identity();
  Match match{guess};
  Values seen;
  for (int step = 0; step < kMostSteps; step++) {
    int k = 0;
    for (int y = -kRadius; y <= kRadius; y++)
      for (int x = -kRadius; x <= kRadius; x++, k++) {
        const double at_x = match.point.x + warp(0, 0) * x + warp(0, 1) * y;
        const double at_y = match.point.y + warp(1, 0) * x + warp(1, 1) * y;
        if (!image.has(at_x, at_y)) return std::nullopt;
        seen[k] = image.value(at_x, at_y);
      }
    if (!normalise(seen)) return std::nullopt;
    match.correlation = weights().cwiseProduct(seen).dot(values_);
    const Eigen::Matrix<float, kTerms, 1> change = step_ * (seen - values_);
    Eigen::Matrix2d back;
    back << 1 + change[2] / kRadius, change[3] / kRadius, change[4] / kRadius, 1 + change[5] / kRadius;
    if (!(back.determinant() > kLeastScale)) return std::nullopt;
    warp = warp * back.inverse();
    const Eigen::Vector2d shift = warp * change.head<2>().cast<double>();
    match.point -= Vec2(shift.x(), shift.y());
    if (!(glm::length(match.point - guess) < kFarthest) || !((warp - Eigen::Matrix2d::Identity()).norm() < kMostWarp))
      return std::nullopt;
    if (change.norm() < kSmallStep) break;
  }
  return match;
}

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
