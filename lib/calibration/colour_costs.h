// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include <ceres/ceres.h>

#include "calibration/colour_samples.h"
#include "image/colour_model.h"

// What fit_colours() minimises.
namespace lf::colour {

// Parameters of a camera, all 0 without faults.
enum Place {
  kExposure = 0,
  kRed = 1,
  kBlue = 2,
  kBlack = 3,
  kGamma = 6,
  kCrosstalk = 7,
  kVignetting = 13,
  kCount = 15
};
using Parameters = std::array<double, kCount>;

inline constexpr double kBlackUnit = 10;  // levels
// What cameras are likely to be off by: next to nothing beside samples that say more.
inline constexpr std::array<double, kCount> kPrior{1.0, 0.5, 0.5, 1.0, 1.0, 1.0, 0.2, 0.1,
                                                   0.1, 0.1, 0.1, 0.1, 0.1, 0.5, 0.5};

// The matrix that takes light of the scene to light that the camera takes for its own: gains of rows, and crosstalk
// under which grey stays grey.
template <typename T>
void own_from_scene(const T* p, T (&out)[3][3]) {
  using std::exp;
  const T gain[3] = {exp(p[kExposure] + p[kRed]), exp(p[kExposure]), exp(p[kExposure] + p[kBlue])};
  for (int row = 0, k = kCrosstalk; row < 3; row++) {
    T others(0);
    for (int column = 0; column < 3; column++)
      if (column != row) {
        out[row][column] = gain[row] * p[k];
        others += p[k++];
      }
    out[row][row] = gain[row] * (1.0 - others);
  }
}

// light_of() and level_of() for the solver's numbers.
template <typename T>
T power_light(const T& level, const T& gamma) {
  using std::pow;
  const bool below = level < T(0);
  const T v = below ? -level : level;
  const T light = v >= T(kToe) ? pow(v / 255.0, gamma) : v / kToe * pow(T(kToe / 255), gamma);
  return below ? -light : light;
}
template <typename T>
T power_level(const T& light, const T& gamma) {
  using std::pow;
  const bool below = light < T(0);
  const T v = below ? -light : light, toe = pow(T(kToe / 255), gamma);
  const T level = v >= toe ? 255.0 * pow(v, 1.0 / gamma) : v / toe * kToe;
  return below ? -level : level;
}

// What a sample is off the levels that the camera gives for the patch, by the inverse of ColourModel.
struct SampleCost {
  ColourSample sample;
  double r2;

  template <typename T>
  bool operator()(const T* camera, const T* patch, T* residual) const {
    using std::exp;
    using std::pow;
    const T share = 1.0 + r2 * (camera[kVignetting] + r2 * camera[kVignetting + 1]);
    if (share < T(0.05)) return false;
    const T factor = pow(share, 1 / kPictureGamma);
    T light[3], own[3][3];
    for (int c = 0; c < 3; c++) light[c] = power_light(T(255.0 * patch[c] * factor), T(kPictureGamma));
    own_from_scene(camera, own);
    const T gamma = kPictureGamma * exp(camera[kGamma]);
    for (int c = 0; c < 3; c++) {
      if (!sample.usable[static_cast<size_t>(c)]) {
        residual[c] = T(0);
        continue;
      }
      // What cameras make of the darkest levels is less certain.
      const double dark = 1.5 * std::max(0.0, 1 - sample.level[c] / 45), sigma = std::hypot(sample.sigma, dark);
      const T sum = own[c][0] * light[0] + own[c][1] * light[1] + own[c][2] * light[2];
      residual[c] = (power_level(sum, gamma) + kBlackUnit * camera[kBlack + c] - sample.level[c]) / sigma;
    }
    return true;
  }
};

// A chart somewhere: how bright it is, and how much brighter to its right and its lower side.
inline constexpr int kLight = 3;
inline constexpr double kSlope = 0.05;
inline constexpr double kChartSigma = 1;  // levels: a chart is not all matt, and not all flat

// How far a patch is from the colour that the chart has there, in the light that the chart is in.
struct ChartCost {
  double u, v;  // -1 to 1 along the chart

  template <typename T>
  bool operator()(const T* patch, const T* light, const T* reflectance, T* residual) const {
    const T factor = light[0] * (1.0 + u * light[1] + v * light[2]);
    for (int c = 0; c < 3; c++) residual[c] = (patch[c] - factor * reflectance[c]) * (255 / kChartSigma);
    return true;
  }
};

struct LightPrior {
  template <typename T>
  bool operator()(const T* light, T* residual) const {
    residual[0] = light[0] - 1.0;  // since a lighter chart in less light would look the same
    for (int i = 1; i < kLight; i++) residual[i] = light[i] / kSlope;
    return true;
  }
};

struct PriorCost {
  template <typename T>
  bool operator()(const T* camera, T* residual) const {
    for (int i = 0; i < kCount; i++) residual[i] = camera[i] / kPrior[static_cast<size_t>(i)];
    return true;
  }
};

// How far the mean of the cameras is from a camera without faults, but for vignetting, which is no matter of taste.
class MeanCost : public ceres::CostFunction {
 public:
  explicit MeanCost(int cameras) : weight_(1 / (kSigma * cameras)) {
    set_num_residuals(kVignetting);
    mutable_parameter_block_sizes()->assign(static_cast<size_t>(cameras), kCount);
  }
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const size_t n = parameter_block_sizes().size();
    for (int k = 0; k < kVignetting; k++) {
      residuals[k] = 0;
      for (size_t i = 0; i < n; i++) residuals[k] += weight_ * parameters[i][k];
    }
    for (size_t i = 0; jacobians && i < n; i++) {
      if (!jacobians[i]) continue;
      std::fill_n(jacobians[i], kVignetting * kCount, 0.0);
      for (int k = 0; k < kVignetting; k++) jacobians[i][k * kCount + k] = weight_;
    }
    return true;
  }

 private:
  static constexpr double kSigma = 1e-4;
  double weight_;
};

}  // namespace lf::colour
