// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

// Ceres' headers are heavy: include this only where the problem is built.

#include <array>
#include <cmath>

#include <ceres/ceres.h>
#include <Eigen/Core>

#include "calibration/adjustment.h"
#include "calibration/projection.h"

namespace lf {

// Steps of a camera: a rotation about the world's axes (radians), a shift, then those lens terms that are free.
class CameraManifold : public ceres::Manifold {
 public:
  CameraManifold(const std::array<bool, kNumLensTerms>& free, bool free_pose) : pose_(free_pose ? 6 : 0) {
    for (int i = 0; i < kNumLensTerms; i++)
      if (free[i]) lens_[num_lens_++] = 7 + i;
  }
  int AmbientSize() const override { return CameraState::kSize; }
  int TangentSize() const override { return pose_ + num_lens_; }

  bool Plus(const double* x, const double* delta, double* y) const override {
    std::copy(x, x + CameraState::kSize, y);
    if (pose_) {
      const double angle = std::sqrt(delta[0] * delta[0] + delta[1] * delta[1] + delta[2] * delta[2]);
      const double s = angle > 1e-12 ? std::sin(angle / 2) / angle : 0.5, c = std::cos(angle / 2);
      const double a = s * delta[0], b = s * delta[1], d = s * delta[2];
      y[0] = c * x[0] - a * x[1] - b * x[2] - d * x[3];
      y[1] = c * x[1] + a * x[0] + b * x[3] - d * x[2];
      y[2] = c * x[2] + b * x[0] + d * x[1] - a * x[3];
      y[3] = c * x[3] + d * x[0] + a * x[2] - b * x[1];
      for (int i = 0; i < 3; i++) y[4 + i] = x[4 + i] + delta[3 + i];
    }
    for (int i = 0; i < num_lens_; i++) y[lens_[i]] += delta[pose_ + i];
    return true;
  }
  bool PlusJacobian(const double* x, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> j(jacobian, AmbientSize(),
                                                                                         TangentSize());
    j.setZero();
    if (pose_) {
      const double h[4][3] = {{-x[1], -x[2], -x[3]}, {x[0], x[3], -x[2]}, {-x[3], x[0], x[1]}, {x[2], -x[1], x[0]}};
      for (int r = 0; r < 4; r++)
        for (int c = 0; c < 3; c++) j(r, c) = h[r][c] / 2;
      for (int i = 0; i < 3; i++) j(4 + i, 3 + i) = 1;
    }
    for (int i = 0; i < num_lens_; i++) j(lens_[i], pose_ + i) = 1;
    return true;
  }
  // Differences of states are never asked for by the minimiser.
  bool Minus(const double*, const double*, double*) const override { return false; }
  bool MinusJacobian(const double*, double*) const override { return false; }

 private:
  int pose_, num_lens_ = 0;
  int lens_[kNumLensTerms];
};

// An observation of a point or of one end of a bar, in sigmas.
template <bool kBar>
struct ReprojectionCost {
  const CameraState* camera;
  Vec2 pixel;
  uint32_t light;
  double weight;

  template <class T>
  bool operator()(const T* state, const T* target, T* error) const {
    T end[3], projected[2];
    const T* point = target;
    if constexpr (kBar) {
      projection::bar_end(target, light, end);
      point = end;
    }
    if (!projection::project(state, camera->aspect, camera->p1, camera->p2, point, projected)) return false;
    error[0] = (projected[0] - T(pixel.x)) * T(weight);
    error[1] = (projected[1] - T(pixel.y)) * T(weight);
    return true;
  }
};

struct LensPriorCost {
  const LensPrior* prior;
  template <class T>
  bool operator()(const T* state, T* error) const {
    for (int r = 0; r < kNumLensTerms; r++) {
      error[r] = T(0);
      for (int c = 0; c < kNumLensTerms; c++)
        error[r] += T(prior->root_information[r * kNumLensTerms + c]) * (state[7 + c] - T(prior->mean[c]));
    }
    return true;
  }
};

// A lens near its batch's mean.
struct BatchSpreadCost {
  std::array<double, kNumLensTerms> weight;
  template <class T>
  bool operator()(const T* state, const T* mean, T* error) const {
    for (int i = 0; i < kNumLensTerms; i++) error[i] = (state[7 + i] - mean[i]) * T(weight[i]);
    return true;
  }
};

// The batch's mean near what is usual.
struct BatchMeanCost {
  const BatchPrior* prior;
  template <class T>
  bool operator()(const T* mean, T* error) const {
    for (int i = 0; i < kNumLensTerms; i++) error[i] = (mean[i] - T(prior->mean[i])) / T(prior->width[i]);
    return true;
  }
};

}  // namespace lf
