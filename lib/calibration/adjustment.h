// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "base/json_value.h"
#include "calibration/tracks.h"
#include "geometry/pose.h"
#include "rig/rig.h"

namespace lf {

// Lens parameters that calibration estimates; all arrays use this order. The aspect ratio fy/fx is never estimated.
enum LensTerm { kF, kCx, kCy, kK1, kK2, kP1, kP2, kNumLensTerms };
inline constexpr const char* kLensTermNames[kNumLensTerms] = {"f", "cx", "cy", "k1", "k2", "p1", "p2"};

// A camera during calibration, as one flat parameter block: world_from_camera, then the lens.
struct CameraState {
  static constexpr int kSize = 7 + kNumLensTerms;
  std::array<double, kSize> v{1, 0, 0, 0, 0, 0, 0, 1};  // w x y z, position, f cx cy k1 k2 p1 p2
  double aspect = 1;                                    // fy / fx, constant
  int width = 0, height = 0;
  bool used = false;  // true if the camera takes part: it has enough observations in common with other cameras

  Pose pose() const { return {{v[4], v[5], v[6]}, {v[0], v[1], v[2], v[3]}}; }
  void set_pose(const Pose& pose);
  double* lens_terms() { return v.data() + 7; }
  const double* lens_terms() const { return v.data() + 7; }
  // Returns a RADIAL lens, or OPENCV for non-zero p1 or p2 or an aspect ratio other than 1.
  Lens lens() const;
  void set_lens(const Lens& lens);
};

// A light position: a point, or the centre and the direction (unit vector) of a bar. The length of a bar is the unit of
// length.
struct TargetState {
  enum class Kind : uint8_t { kNone, kPoint, kBar };
  std::array<double, 6> v{};
  Kind kind = Kind::kNone;
  uint32_t light = 0;  // index of the light on the bar, for kPoint

  bool has(uint32_t which) const { return kind == Kind::kBar || (kind == Kind::kPoint && light == which); }
  Vec3 point(uint32_t which) const;
};

// Prior of a lens: the mean and the square root W of the information matrix (upper triangular), so that W (lens - mean)
// has unit covariance. Rows and columns of unknown terms are zero; the batch prior covers these terms.
struct LensPrior {
  std::array<double, kNumLensTerms> mean{};
  std::array<double, kNumLensTerms * kNumLensTerms> root_information{};  // row-major
  std::array<bool, kNumLensTerms> known{};
};

// Prior of a pose: position, then a rotation about the world axes, in the order of a rig's covariance and in the frame
// and metres of the prior rig. Rows and columns of unknown terms are zero.
struct PosePrior {
  static constexpr int kNumTerms = 6;
  Pose mean;
  std::array<double, kNumTerms * kNumTerms> root_information{};
};

// Prior of lenses from one batch. Each lens is within `spread` of the batch mean, or within `tight` for terms that are
// shared by all cameras. The batch mean is within `width` of `mean`. All values are one sigma.
struct BatchPrior {
  std::array<double, kNumLensTerms> mean{}, width{}, spread{}, tight{};
};

struct Reconstruction {
  std::vector<CameraState> cameras;
  std::vector<TargetState> targets;
  std::vector<std::optional<LensPrior>> lens_priors;  // per camera; nullopt: batch prior
  BatchPrior batch;
  std::array<double, kNumLensTerms> batch_mean{};
  // Per camera, or empty. Set only after the scene is aligned with the frame of the priors.
  std::vector<std::optional<PosePrior>> pose_priors;
  double metres = 1;  // metres per unit of the scene; estimated if the unit is the bar's length

  // True if the term has a prior measurement in this camera (otherwise the batch prior applies), or in any camera.
  bool measured(size_t camera, int term) const { return lens_priors[camera] && lens_priors[camera]->known[term]; }
  bool measured(int term) const;
  double spread(int term, bool shared) const { return shared ? batch.tight[term] : batch.spread[term]; }
};

struct AdjustmentOptions {
  std::array<bool, kNumLensTerms> free{};  // lens terms
  // free terms with the same value in all cameras that lack a prior measurement
  std::array<bool, kNumLensTerms> shared{};
  double sigma = 1;          // standard deviation of an observation's x and y, pixels
  double robust = 0;         // residual, in sigmas, beyond which the loss is robust; 0: least squares
  bool redescending = true;  // Cauchy loss; false: Huber loss
  int max_iterations = 50;
  double tolerance = 1e-9;  // relative change of the cost at convergence
  // initial trust region radius; raise for good starts, because weakly constrained modes need long steps
  double trust = 1e4;
  bool free_poses = true, free_targets = true;
};

struct AdjustmentSummary {
  bool ok = false;
  double cost = 0;
  int iterations = 0;
};

using Inliers = std::vector<char>;  // per observation: true if it takes part

// Camera clocks that are adjusted with the scene. A clock error shifts an observation along the motion of its light.
struct ClockAdjustment {
  // Correction of one camera's clock. `terms` are an offset (seconds), a drift about the stamp `middle` (seconds per
  // second), and an additional offset from the stamp `step_at` on (infinite: no step).
  struct Camera {
    std::array<double, 3> terms{};
    double middle = 0, step_at = std::numeric_limits<double>::infinity();
    std::array<double, 3> by(double stamp) const { return {1, stamp - middle, stamp >= step_at ? 1.0 : 0.0}; }
  };
  std::vector<Camera> cameras;
  std::vector<Vec2> velocity;  // image velocity of each observation's light, pixels per second
  std::vector<double> stamp;   // camera stamp of each observation, seconds
};

// Bundle adjustment over the observations with use[i], of used cameras and of targets that have the observed light.
// Also estimates `clocks` if not null; only weak priors constrain their common part.
AdjustmentSummary adjust(Reconstruction& scene, const std::vector<Observation>& observations, const Inliers& use,
                         const AdjustmentOptions& options, ClockAdjustment* clocks = nullptr);

// Returns the reprojection error in pixels (projected minus observed), or nullopt if the target is behind the camera.
std::optional<Vec2> residual(const CameraState& camera, const TargetState& target, const Observation& observation);

// b_from_a between two frames: rotation, uniform scale and translation.
struct Similarity {
  double scale = 1;
  Quat rotation{1, 0, 0, 0};
  Vec3 translation{0, 0, 0};

  Vec3 operator()(const Vec3& point) const { return scale * (rotation * point) + translation; }
  Pose operator()(const Pose& pose) const {
    return {(*this)(pose.position), glm::normalize(rotation * pose.orientation)};
  }
};

// Weight of a radian of rotation in align(), relative to the size of the array. Small, so that camera centres decide,
// but orientations fix a rotation that the centres leave free (one row of cameras, or two cameras).
inline constexpr double kRotationWeight = 1e-3;

double spread(const std::vector<Vec3>& points);  // RMS distance from the mean

// Returns the similarity that aligns poses `a` with poses `b` (least squares over camera centres, Umeyama 1991). Poses
// are paired by index; at least two are required. `fixed_scale` fixes the scale at 1.
Similarity align(const std::vector<Pose>& a, const std::vector<Pose>& b, bool fixed_scale = false);

// Covariance of the cameras of an adjusted scene: the inverse of the information matrix of observations and priors,
// with targets and batch means marginalised. At the true parameters this is the Cramer-Rao bound. Gauge: the scene is
// aligned with the true camera centres by align().
//
// A used camera has these parameters: rotation about the world axes (radians), position (scene units), free lens terms.
struct Uncertainty {
  std::vector<int> camera_row;  // first row of each camera; -1: not used
  int camera_size = 0;          // rows per camera
  std::vector<int> lens_terms;  // of rows 6 and up of each camera
  Eigen::MatrixXd covariance;
  // Covariance of the lens terms before calibration, lens_terms.size() rows per camera.
  Eigen::MatrixXd prior_covariance;

  // Returns the standard deviation of a linear combination of all parameters.
  double sigma_of(const Eigen::VectorXd& weights) const { return std::sqrt(weights.dot(covariance * weights)); }
};

Uncertainty estimate_uncertainty(const Reconstruction& scene, const std::vector<Observation>& observations,
                                 const Inliers& use, const AdjustmentOptions& options);

// Uncertainty of a camera's parameters: the member "covariance" of a camera in a rig file,
//   {"parameters": ["f", "cx", "cy", "k1", "k2", "x", "y", "z", "rx", "ry", "rz"], "matrix": [[...], ...]}
// f, cx, cy are in pixels; k1, k2, p1, p2 as in the lens; x, y, z are the position in metres. rx, ry, rz are rotations
// about the world axes in radians. Parameters that were not estimated are absent.
struct CameraCovariance {
  std::vector<std::string> parameters;
  std::vector<double> matrix;  // row-major, parameters.size() squared

  double at(size_t row, size_t column) const { return matrix[row * parameters.size() + column]; }
  std::optional<size_t> index_of(const std::string& parameter) const;
};

// Parses the covariance of `camera`, an element of a rig file's "cameras". Returns nullopt if it is absent or empty.
// Throws Error with the place if the matrix is not symmetric positive semidefinite of the right size.
std::optional<CameraCovariance> parse_camera_covariance(const JsonValue& camera);
nlohmann::ordered_json to_json(const CameraCovariance& covariance);

}  // namespace lf
