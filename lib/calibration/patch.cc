// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/patch.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

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

}  // namespace lf
