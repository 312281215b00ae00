// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cmath>

#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <Eigen/Core>

#include "calibration/adjustment.h"

namespace lf::projection {

// Rotates a vector from world axes to camera axes: v = conjugate(q) * x * q.
inline void rotate_to_camera(const double* q, const double* x, double* v) {
  const double w = q[0], a = -q[1], b = -q[2], c = -q[3];
  const double tx = 2 * (b * x[2] - c * x[1]), ty = 2 * (c * x[0] - a * x[2]), tz = 2 * (a * x[1] - b * x[0]);
  v[0] = x[0] + w * tx + b * tz - c * ty;
  v[1] = x[1] + w * ty + c * tx - a * tz;
  v[2] = x[2] + w * tz + a * ty - b * tx;
}

struct PixelJacobian {
  Eigen::Matrix<double, 2, 3> by_point;
  Eigen::Matrix<double, 2, kNumLensTerms> by_lens;
};

// Computes (a, b) of geometry/lens.h for a point in camera axes, and the derivative by the point. Returns false if the
// lens cannot see the point. Points beyond the end of the field are accepted, because the solver may pass them.
inline bool undistorted(const double* x, bool fisheye, double* ab, Eigen::Matrix<double, 2, 3>& slopes) {
  double scale = 1 / x[2], slope = 0;  // slope: derivative of the scale by R, divided by R
  double by_z = -scale * scale;        // derivative of the scale by Z
  if (fisheye) {
    constexpr double kMaxAngle = 2.5, kNearAxis = 1e-8;
    const double beside2 = x[0] * x[0] + x[1] * x[1], distance2 = beside2 + x[2] * x[2];
    const double beside = std::sqrt(beside2), angle = std::atan2(beside, x[2]);
    if (!(distance2 > 1e-18 && angle < kMaxAngle)) return false;
    by_z = -1 / distance2;
    slope = -2 / 3.0 * scale * scale * scale;
    if (beside2 > kNearAxis * distance2) {
      scale = angle / beside;
      slope = (x[2] / distance2 - scale) / beside2;
    }
  } else if (!(x[2] > 1e-9)) {
    return false;
  }
  ab[0] = x[0] * scale, ab[1] = x[1] * scale;
  const double across = x[0] * x[1] * slope;
  slopes << scale + x[0] * x[0] * slope, across, x[0] * by_z, across, scale + x[1] * x[1] * slope, x[1] * by_z;
  return true;
}

// project_in_camera() for lenses with more terms than the model OPENCV.
inline bool project_general(const double* x, const double* lens, const CameraState& camera, double* pixel,
                            PixelJacobian* slopes) {
  const Distortion<double>& fixed = camera.fixed;
  const bool has_k34 = camera.model == LensModel::kOpenCvFisheye;
  Eigen::Matrix<double, 2, 3> ab_by_point;
  double ab[2];
  if (!undistorted(x, fixed.fisheye, ab, ab_by_point)) return false;
  const double a = ab[0], b = ab[1], aa = a * a, bb = b * b, two_ab = 2 * a * b, q = aa + bb;
  const double p1 = has_k34 ? 0 : lens[kP1], p2 = has_k34 ? 0 : lens[kP2];
  const double k[] = {lens[kK1], lens[kK2], has_k34 ? lens[kP1] : fixed.k[2], has_k34 ? lens[kP2] : fixed.k[3]};
  const double bottom = 1 + q * (fixed.d[0] + q * (fixed.d[1] + q * fixed.d[2]));
  const double g = (1 + q * (k[0] + q * (k[1] + q * (k[2] + q * k[3])))) / bottom;
  const double da = a * g + p1 * two_ab + p2 * (q + 2 * aa) + fixed.s1 * q;
  const double db = b * g + p1 * (q + 2 * bb) + p2 * two_ab + fixed.s2 * q;
  const double fx = lens[kF], fy = fx * camera.aspect;
  pixel[0] = fx * da + lens[kCx];
  pixel[1] = fy * db + lens[kCy];
  if (!slopes) return true;
  const double top_slope = k[0] + q * (2 * k[1] + q * (3 * k[2] + q * 4 * k[3]));
  const double bottom_slope = fixed.d[0] + q * (2 * fixed.d[1] + q * 3 * fixed.d[2]);
  const double bend = 2 * (top_slope - g * bottom_slope) / bottom;  // twice the derivative of g by q
  const double across = a * b * bend + 2 * (p1 * a + p2 * b);
  Eigen::Matrix2d by_ab;
  by_ab << fx * (g + aa * bend + 2 * p1 * b + 6 * p2 * a + 2 * fixed.s1 * a), fx * (across + 2 * fixed.s1 * b),
      fy * (across + 2 * fixed.s2 * a), fy * (g + bb * bend + 6 * p1 * b + 2 * p2 * a + 2 * fixed.s2 * b);
  slopes->by_point = by_ab * ab_by_point;
  const double r1 = q / bottom, r2 = q * r1, r3 = q * r2, r4 = q * r3;
  slopes->by_lens << da, 1, 0, fx * a * r1, fx * a * r2, fx * (has_k34 ? a * r3 : two_ab),
      fx * (has_k34 ? a * r4 : q + 2 * aa),  //
      camera.aspect * db, 0, 1, fy * b * r1, fy * b * r2, fy * (has_k34 ? b * r3 : q + 2 * bb),
      fy * (has_k34 ? b * r4 : two_ab);
  return true;
}

// Projects a point in camera axes to a pixel, with the lens terms of a CameraState block (the model of
// geometry/lens.h). `camera` has the constants of the lens. Returns false if the lens cannot see the point. `slopes`
// receives the derivatives; it may be null.
inline bool project_in_camera(const double* x, const double* lens, const CameraState& camera, double* pixel,
                              PixelJacobian* slopes = nullptr) {
  if (camera.fixed.is_general) return project_general(x, lens, camera, pixel, slopes);
  if (!(x[2] > 1e-9)) return false;
  const double aspect = camera.aspect;
  const double f = lens[kF], g = f * aspect, k1 = lens[kK1], k2 = lens[kK2], p1 = lens[kP1], p2 = lens[kP2];
  const double u = x[0] / x[2], v = x[1] / x[2], uu = u * u, uv = u * v, vv = v * v, r2 = uu + vv;
  const double radial = 1 + r2 * (k1 + r2 * k2);
  const double du = u * radial + 2 * p1 * uv + p2 * (r2 + 2 * uu);
  const double dv = v * radial + p1 * (r2 + 2 * vv) + 2 * p2 * uv;
  pixel[0] = f * du + lens[kCx];
  pixel[1] = g * dv + lens[kCy];
  if (!slopes) return true;
  const double bend = 2 * (k1 + 2 * k2 * r2);  // twice the derivative of the radial factor by r^2
  const double across = uv * bend + 2 * (p1 * u + p2 * v);
  const double uu_slope = radial + uu * bend + 2 * p1 * v + 6 * p2 * u;
  const double vv_slope = radial + vv * bend + 6 * p1 * v + 2 * p2 * u;
  Eigen::Matrix<double, 2, 3> by_ray;
  by_ray << uu_slope, across, -(u * uu_slope + v * across), across, vv_slope, -(u * across + v * vv_slope);
  slopes->by_point.row(0) = f / x[2] * by_ray.row(0);
  slopes->by_point.row(1) = g / x[2] * by_ray.row(1);
  slopes->by_lens << du, 1, 0, f * u * r2, f * u * r2 * r2, f * 2 * uv, f * (r2 + 2 * uu),  //
      aspect * dv, 0, 1, g * v * r2, g * v * r2 * r2, g * (r2 + 2 * vv), g * 2 * uv;
  return true;
}

// Projects a world point to a pixel. Returns false if the lens cannot see the point.
inline bool project(const CameraState& camera, const double* point, double* pixel) {
  const double from_centre[3] = {point[0] - camera.v[4], point[1] - camera.v[5], point[2] - camera.v[6]};
  double x[3];
  rotate_to_camera(camera.v.data(), from_centre, x);
  return project_in_camera(x, camera.lens_terms(), camera, pixel);
}

// Position of a light on a bar of unit length: light 0 is at -1/2, light 1 at +1/2.
inline double bar_side(unsigned light) { return light == 0 ? -0.5 : 0.5; }
inline void bar_end(const double* bar, unsigned light, double* point) {
  for (int i = 0; i < 3; i++) point[i] = bar[i] + bar_side(light) * bar[3 + i];
}

// Position of a corner of a board; `corner` is in board axes.
inline void board_corner(const double* board, const double* corner, double* point) {
  const double inverse[4] = {board[3], -board[4], -board[5], -board[6]};
  rotate_to_camera(inverse, corner, point);
  for (int i = 0; i < 3; i++) point[i] += board[i];
}
}  // namespace lf::projection

namespace lf {

// The Ceres headers are slow to compile: include this file only where a problem is built.

// Defines how the solver changes a camera: a rotation about the world axes (radians), a translation, and the free lens
// terms.
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
      j.topLeftCorner<4, 3>() = quaternion_steps(x);
      for (int i = 0; i < 3; i++) j(4 + i, 3 + i) = 1;
    }
    for (int i = 0; i < num_lens_; i++) j(lens_[i], pose_ + i) = 1;
    return true;
  }
  // Returns the derivative of the quaternion at `x` by small rotations about the world axes.
  static Eigen::Matrix<double, 4, 3> quaternion_steps(const double* x) {
    Eigen::Matrix<double, 4, 3> steps;
    steps << -x[1], -x[2], -x[3], x[0], x[3], -x[2], -x[3], x[0], x[1], x[2], -x[1], x[0];
    return steps / 2;
  }
  // The minimiser never calls Minus.
  bool Minus(const double*, const double*, double*) const override { return false; }
  bool MinusJacobian(const double*, double*) const override { return false; }

 private:
  int pose_, num_lens_ = 0;
  int lens_[kNumLensTerms];
};

// Returns a cost function that Ceres differentiates. `kSizes` are the numbers of residuals and of the values in each
// block.
template <int... kSizes, class Cost>
ceres::CostFunction* auto_diff(const Cost& cost) {
  return new ceres::AutoDiffCostFunction<Cost, kSizes...>(new Cost(cost));
}

// Number of the coordinates in TargetState::v that a kind of target uses.
constexpr int target_size(TargetState::Kind kind) {
  return kind == TargetState::Kind::kBoard ? 7 : kind == TargetState::Kind::kBar ? 6 : 3;
}

// Calls f.operator()<kind>().
template <class F>
auto with_kind(TargetState::Kind kind, const F& f) {
  using Kind = TargetState::Kind;
  switch (kind) {
    case Kind::kBar: return f.template operator()<Kind::kBar>();
    case Kind::kBoard: return f.template operator()<Kind::kBoard>();
    default: return f.template operator()<Kind::kPoint>();
  }
}

using BarManifold = ceres::ProductManifold<ceres::EuclideanManifold<3>, ceres::SphereManifold<3>>;
using BoardManifold = ceres::ProductManifold<ceres::EuclideanManifold<3>, ceres::QuaternionManifold>;

// Reprojection error of a point, of one end of a bar or of a corner of a board, in sigmas.
template <TargetState::Kind kKind>
class ReprojectionCost : public ceres::SizedCostFunction<2, CameraState::kSize, target_size(kKind)> {
  static constexpr bool kBar = kKind == TargetState::Kind::kBar, kBoard = kKind == TargetState::Kind::kBoard;

 public:
  ReprojectionCost(const CameraState& camera, const TargetState& target, const Observation& observation, double sigma)
      : camera_(camera),
        pixel_(observation.pixel),
        light_(observation.light),
        corner_(kBoard ? (*target.corners)[observation.light] : Vec3(0, 0, 0)),
        weight_(1 / (sigma * observation.sigma)) {}

  bool Evaluate(const double* const* blocks, double* error, double** jacobians) const override {
    const double *state = blocks[0], *point = blocks[1];
    double end[3], pixel[2];
    if constexpr (kBar) {
      projection::bar_end(blocks[1], light_, end);
      point = end;
    } else if constexpr (kBoard) {
      projection::board_corner(blocks[1], &corner_.x, end);
      point = end;
    }
    const Eigen::Vector3d from_centre(point[0] - state[4], point[1] - state[5], point[2] - state[6]);
    Eigen::Vector3d in_camera;
    projection::rotate_to_camera(state, from_centre.data(), in_camera.data());
    projection::PixelJacobian slopes;
    if (!projection::project_in_camera(in_camera.data(), state + 7, camera_, pixel, jacobians ? &slopes : nullptr))
      return false;
    if (jacobians) differentiate(blocks, from_centre, slopes, jacobians);
    error[0] = (pixel[0] - pixel_.x) * weight_;
    error[1] = (pixel[1] - pixel_.y) * weight_;
    return true;
  }

 private:
  void differentiate(const double* const* blocks, const Eigen::Vector3d& from_centre,
                     const projection::PixelJacobian& slopes, double** jacobians) const {
    const double* state = blocks[0];
    const Eigen::Matrix<double, 2, 3> by_camera_axes = weight_ * slopes.by_point;
    const Eigen::Matrix3d world_from_camera =
        Eigen::Quaterniond(state[0], state[1], state[2], state[3]).toRotationMatrix();
    const Eigen::Matrix<double, 2, 3> by_point = by_camera_axes * world_from_camera.transpose();
    if (jacobians[0]) {
      Eigen::Map<Eigen::Matrix<double, 2, CameraState::kSize, Eigen::RowMajor>> j(jacobians[0]);
      // The manifold's columns are orthogonal with length 1/2, so these quaternion derivatives map to by_turn.
      Eigen::Matrix<double, 2, 3> by_turn;
      for (int r = 0; r < 2; r++) by_turn.row(r) = by_point.row(r).cross(from_centre);
      j.leftCols<4>() = 4 * by_turn * CameraManifold::quaternion_steps(state).transpose();
      j.middleCols<3>(4) = -by_point;
      j.rightCols<kNumLensTerms>() = weight_ * slopes.by_lens;
    }
    if (jacobians[1]) {
      Eigen::Map<Eigen::Matrix<double, 2, target_size(kKind), Eigen::RowMajor>> j(jacobians[1]);
      j.template leftCols<3>() = by_point;
      if constexpr (kBar) j.template rightCols<3>() = projection::bar_side(light_) * by_point;
      if constexpr (kBoard) {
        const double* board = blocks[1];
        const Eigen::Vector3d from_middle = Eigen::Quaterniond(board[3], board[4], board[5], board[6]) *
                                            Eigen::Vector3d(corner_.x, corner_.y, corner_.z);
        Eigen::Matrix<double, 2, 3> by_turn;
        for (int r = 0; r < 2; r++) by_turn.row(r) = from_middle.cross(Eigen::Vector3d(by_point.row(r)));
        j.template rightCols<4>() = 4 * by_turn * CameraManifold::quaternion_steps(board + 3).transpose();
      }
    }
  }

  const CameraState& camera_;
  Vec2 pixel_;
  uint32_t light_;
  Vec3 corner_;  // in board axes
  double weight_;
};

// A ReprojectionCost for a moving light and an unknown clock. Each second added to the clock means that the frame shows
// an earlier moment, so the light is displaced by -velocity.
inline constexpr int kNumClockTerms = 3;
template <TargetState::Kind kKind>
class ClockedCost : public ceres::SizedCostFunction<2, CameraState::kSize, target_size(kKind), kNumClockTerms> {
 public:
  ClockedCost(const CameraState& camera, const TargetState& target, const Observation& observation, double sigma,
              const Vec2& velocity, const std::array<double, kNumClockTerms>& by)
      : still_(camera, target, observation, sigma) {
    const double weight = 1 / (sigma * observation.sigma);
    for (int k = 0; k < kNumClockTerms; k++) by_terms_(0, k) = weight * velocity.x * by[k];
    for (int k = 0; k < kNumClockTerms; k++) by_terms_(1, k) = weight * velocity.y * by[k];
  }
  bool Evaluate(const double* const* blocks, double* error, double** jacobians) const override {
    if (!still_.Evaluate(blocks, error, jacobians)) return false;
    Eigen::Map<Eigen::Vector2d>(error) += by_terms_ * Eigen::Map<const Eigen::Vector3d>(blocks[2]);
    if (jacobians && jacobians[2]) {
      Eigen::Map<Eigen::Matrix<double, 2, kNumClockTerms, Eigen::RowMajor>> by_clock(jacobians[2]);
      by_clock = by_terms_;
    }
    return true;
  }

 private:
  ReprojectionCost<kKind> still_;
  Eigen::Matrix<double, 2, kNumClockTerms> by_terms_;
};

// Weak prior of the terms of a clock. It fixes the common part of all clocks, and terms without observations.
inline constexpr double kClockSigmas[kNumClockTerms] = {0.1, 3e-4, 0.2};  // seconds, seconds per second, seconds
struct ClockPriorCost {
  template <class T>
  bool operator()(const T* terms, T* error) const {
    for (int k = 0; k < kNumClockTerms; k++) error[k] = terms[k] / kClockSigmas[k];
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

// Prior of a pose. `metres` is the number of metres of the prior's frame per unit of the scene.
struct PosePriorCost {
  const PosePrior* prior;
  template <class T>
  bool operator()(const T* state, const T* metres, T* error) const {
    const Quat& q = prior->mean.orientation;
    const T mean[4] = {T(q.w), T(-q.x), T(-q.y), T(-q.z)};
    T turn[4], off[PosePrior::kNumTerms];
    ceres::QuaternionProduct(state, mean, turn);
    const T sign(turn[0] < T(0) ? -2 : 2);
    for (int i = 0; i < 3; i++) {
      off[i] = state[4 + i] * metres[0] - T(prior->mean.position[i]);
      off[3 + i] = sign * turn[1 + i];
    }
    for (int r = 0; r < PosePrior::kNumTerms; r++) {
      error[r] = T(0);
      for (int c = 0; c < PosePrior::kNumTerms; c++)
        error[r] += T(prior->root_information[r * PosePrior::kNumTerms + c]) * off[c];
    }
    return true;
  }
};

struct BatchSpreadCost {
  std::array<double, kNumLensTerms> weight;
  template <class T>
  bool operator()(const T* state, const T* mean, T* error) const {
    for (int i = 0; i < kNumLensTerms; i++) error[i] = (state[7 + i] - mean[i]) * T(weight[i]);
    return true;
  }
};

struct BatchMeanCost {
  const BatchPrior* prior;
  template <class T>
  bool operator()(const T* mean, T* error) const {
    for (int i = 0; i < kNumLensTerms; i++) error[i] = (mean[i] - T(prior->mean[i])) / T(prior->width[i]);
    return true;
  }
};

}  // namespace lf
