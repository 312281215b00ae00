// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/colour_model.h"

#include <algorithm>
#include <cmath>

#include "base/number_text.h"

namespace lf {
namespace {

double determinant(const std::array<double, 9>& m) {
  return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) + m[2] * (m[3] * m[7] - m[4] * m[6]);
}

}  // namespace

double light_of(double level, double gamma) {
  const double v = std::abs(level);
  const double light = v >= kToe ? std::pow(v / 255, gamma) : v / kToe * std::pow(kToe / 255, gamma);
  return std::copysign(light, level);
}

double level_of(double light, double gamma) {
  const double toe = std::pow(kToe / 255, gamma), v = std::abs(light);
  return std::copysign(v >= toe ? 255 * std::pow(v, 1 / gamma) : v / toe * kToe, light);
}

VignettingField::VignettingField(int width, int height, const Vec2& centre)
    : centre_(centre), scale_(4.0 / (static_cast<double>(width) * width + static_cast<double>(height) * height)) {
  most_ = std::max({square(0, 0), square(width - 1, 0), square(0, height - 1), square(width - 1, height - 1)});
}

double VignettingField::square(double x, double y) const {
  const double dx = x - centre_.x, dy = y - centre_.y;
  return scale_ * (dx * dx + dy * dy);
}

double light_share(const ColourModel& model, double r2) {
  return 1 + r2 * (model.vignetting[0] + r2 * model.vignetting[1]);
}

Vec3 corrected(const ColourModel& model, const Vec3& level) {
  double light[3];
  for (int c = 0; c < 3; c++) light[c] = light_of(level[c] - model.black[c], model.gamma);
  Vec3 out;
  for (int c = 0; c < 3; c++) {
    const double* const row = &model.matrix[static_cast<size_t>(3 * c)];
    out[c] = level_of(row[0] * light[0] + row[1] * light[1] + row[2] * light[2]);
  }
  return out;
}

double level_factor(double light_share) { return std::pow(light_share, -1 / kPictureGamma); }

std::optional<std::string> fault_of(const ColourModel& model, double most_r2) {
  using M = ColourModel;
  const auto bounds = [](double least, double most) {
    return ": must be " + number_text(least) + " to " + number_text(most);
  };
  for (int c = 0; c < 3; c++)
    if (!(std::abs(model.black[c]) <= M::kMostBlack))
      return "black[" + std::to_string(c) + "]" + bounds(-M::kMostBlack, M::kMostBlack);
  if (!(model.gamma >= M::kLeastGamma && model.gamma <= M::kMostGamma))
    return "gamma" + bounds(M::kLeastGamma, M::kMostGamma);
  for (size_t i = 0; i < model.matrix.size(); i++)
    if (!(std::abs(model.matrix[i]) <= M::kMostEntry))
      return "matrix[" + std::to_string(i) + "]" + bounds(-M::kMostEntry, M::kMostEntry);
  if (!(determinant(model.matrix) >= 1e-4))
    return "matrix: must keep colours apart: its determinant must be 0.0001 or more";
  // A parabola in r^2: its ends and its vertex.
  double least = 1, most = 1;
  const auto look_at = [&](double r2) {
    const double share = light_share(model, r2);
    // NaN stays.
    if (!(share >= least)) least = share;
    if (!(share <= most)) most = share;
  };
  look_at(most_r2);
  if (const double k2 = model.vignetting[1]; k2 != 0) {
    const double vertex = -model.vignetting[0] / (2 * k2);
    if (vertex > 0 && vertex < most_r2) look_at(vertex);
  }
  if (!(least >= M::kLeastLight && most <= M::kMostLight))
    return "vignetting: must leave " + number_text(M::kLeastLight) + " to " + number_text(M::kMostLight) +
           " of the light in all of the image";
  return std::nullopt;
}

}  // namespace lf
