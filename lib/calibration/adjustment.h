// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
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

// The lens parameters that calibration can estimate. All arrays use this order. The aspect ratio fy / fx is never
// estimated. A lens of the model OPENCV_FISHEYE has no p1 and p2: its k3 and k4 are in their place.
enum LensTerm { kF, kCx, kCy, kK1, kK2, kP1, kP2, kNumLensTerms };

// A camera during calibration. Pose (world_from_camera) and lens are one flat parameter block for the solver.
struct CameraState {
  static constexpr int kSize = 7 + kNumLensTerms;
  std::array<double, kSize> v{1, 0, 0, 0, 0, 0, 0, 1};  // w x y z, position, f cx cy k1 k2 p1 p2
  double aspect = 1;                                    // fy / fx, constant
  LensModel model = LensModel::kOpenCv;                 // or a model with further terms, which `fixed` contains
  // The terms of the lens that are not estimated; the terms in `v` are 0.
  Distortion<double> fixed;
  int width = 0, height = 0;
  // The camera takes part in the calibration, because it has enough observations in common with other cameras.
  bool used = false;

  Pose pose() const { return {{v[4], v[5], v[6]}, {v[0], v[1], v[2], v[3]}}; }
  void set_pose(const Pose& pose);
  double* lens_terms() { return v.data() + 7; }
  const double* lens_terms() const { return v.data() + 7; }
  // For the model OPENCV, returns a RADIAL lens unless p1 or p2 is not 0 or the aspect ratio is not 1.
  Lens lens() const;
  // Stores any lens. The models SIMPLE_RADIAL_FISHEYE and RADIAL_FISHEYE become OPENCV_FISHEYE.
  void set_lens(const Lens& lens);
  const char* term_name(int term) const;  // as in the covariance of a rig file, for example "k1"
};

// The position of the calibration target at one instant. The target is a moving light, a bar with a light at each end,
// or a board with corners. A bar is stored as its centre and its direction (unit vector), a board as the position of
// its middle and its orientation (quaternion w x y z). The unit of length of the scene is the length of the bar, or
// metres for a board.
struct TargetState {
  enum class Kind : uint8_t { kNone, kPoint, kBar, kBoard };
  std::array<double, 7> v{};
  Kind kind = Kind::kNone;
  uint32_t light = 0;                                // kPoint only: which light of the bar it is
  std::shared_ptr<const std::vector<Vec3>> corners;  // kBoard only: Tracks::board

  static TargetState at(const Vec3& point);  // a kPoint of light 0
  bool is_rigid() const { return kind == Kind::kBar || kind == Kind::kBoard; }
  bool has(uint32_t which) const {
    return kind == Kind::kBar || (kind == Kind::kPoint && light == which) ||
           (kind == Kind::kBoard && which < corners->size());
  }
  Vec3 point(uint32_t which) const;
  void set_board(const Pose& world_from_board, std::shared_ptr<const std::vector<Vec3>> board_corners);
};

// Prior knowledge of one lens, for example from images of a checkerboard. It consists of a mean and the square root W
// of the information matrix (upper triangular), so that W (lens - mean) has unit covariance. Terms that are not known
// have zero rows and columns in W, so that only the batch prior applies.
struct LensPrior {
  std::array<double, kNumLensTerms> mean{};
  std::array<double, kNumLensTerms * kNumLensTerms> root_information{};
  std::array<bool, kNumLensTerms> known{};
};

// Prior knowledge of one pose, from an earlier calibration. The terms are the position in metres and then a rotation
// about the world axes in radians, as in the covariance of a rig file. They use the coordinates of the rig that the
// prior comes from. Terms that are not known have zero rows and columns.
struct PosePrior {
  static constexpr int kNumTerms = 6;
  Pose mean;
  std::array<double, kNumTerms * kNumTerms> root_information{};
};

// Prior knowledge of all lenses together. It applies to terms that no LensPrior has measured. Lenses of the same model
// come from one batch, so they differ little from the mean lens of the batch, which is estimated, too. The members
// except `mean` are standard deviations of each lens term:
// - `width`: of the mean lens of the batch from `mean`,
// - `spread`: of a lens from the mean lens of the batch,
// - `tight`: like `spread`, for terms that all cameras share.
struct BatchPrior {
  std::array<double, kNumLensTerms> mean{}, width{}, spread{}, tight{};
};

struct Reconstruction {
  std::vector<CameraState> cameras;
  std::vector<TargetState> targets;
  std::vector<std::optional<LensPrior>> lens_priors;  // per camera; nullopt: only the batch prior applies
  BatchPrior batch;
  std::array<double, kNumLensTerms> batch_mean{};
  // Per camera, or empty. Set only after the scene has been aligned with the frame of the priors.
  std::vector<std::optional<PosePrior>> pose_priors;
  double metres = 1;  // metres of the priors per unit of length of the scene; estimated if the targets are rigid

  // True if the prior has measured the term in this camera, or in any camera. Otherwise the batch prior applies.
  bool measured(size_t camera, int term) const { return lens_priors[camera] && lens_priors[camera]->known[term]; }
  bool measured(int term) const;
  std::vector<Pose> used_poses() const;  // poses of the used cameras
  // Returns residual() of an observation, or nullopt also if its camera is not used or its light has no position.
  std::optional<Vec2> residual_of(const Observation& observation) const;
  double spread(int term, bool shared) const { return shared ? batch.tight[term] : batch.spread[term]; }
};

struct AdjustmentOptions {
  std::array<bool, kNumLensTerms> free{};
  // Free terms with one common value for all cameras that have no prior measurement.
  std::array<bool, kNumLensTerms> shared{};
  double sigma = 1;          // standard deviation of x and y of an observation, pixels
  double robust = 0;         // threshold of the robust loss, in sigmas; 0: least squares
  bool redescending = true;  // true: Cauchy loss; false: Huber loss
  int max_iterations = 50;
  double tolerance = 1e-9;  // relative change of the cost at convergence
  // Initial radius of the trust region. Raise it for good starts, because weakly constrained modes need long steps.
  double trust = 1e4;
  bool free_poses = true;
};

using Inliers = std::vector<char>;  // per observation: true if it takes part

struct ClockAdjustment {
  // Correction of the clock of one camera. `terms` are an offset in seconds, a drift in seconds per second about the
  // stamp `middle`, and, in seconds, either an additional offset from the stamp `step_at` on (infinity: no step) or the
  // readout time of a rolling shutter. Each image row is later than the row above by the readout time over the height.
  struct Camera {
    std::array<double, 3> terms{};
    double middle = 0, step_at = std::numeric_limits<double>::infinity();
    bool drifts = true, rolls = false;  // a drift or a readout time is estimated
  };
  std::vector<Camera> cameras;
  std::vector<Vec2> velocity;  // image velocity of each observation's light, pixels per second
  std::vector<double> stamp;   // when each observation was made, according to its camera, seconds
  // Distance of each observation below the middle of the image, in image heights. Needed only if cameras roll.
  std::vector<double> row;

  // Derivatives of the time of observation `i`, of camera `camera`, by the terms of the camera.
  std::array<double, 3> by(size_t camera, size_t i) const {
    const Camera& c = cameras[camera];
    return {1, c.drifts ? stamp[i] - c.middle : 0, c.rolls ? row[i] : stamp[i] >= c.step_at ? 1.0 : 0.0};
  }
};

// Bundle adjustment: changes the cameras, the light positions and, if `clocks` is not null, the clocks of `scene` so
// that the reprojection errors become minimal. Observation i is used if use[i] is true, its camera is used and its
// light position is known. The observations determine only the differences between clocks, so weak priors fix the
// common part of all clocks.
void adjust(Reconstruction& scene, const std::vector<Observation>& observations, const Inliers& use,
            const AdjustmentOptions& options, ClockAdjustment* clocks = nullptr);

// Returns the reprojection error (projected minus observed position) of an observation in pixels. Returns nullopt if
// the light is behind the camera.
std::optional<Vec2> residual(const CameraState& camera, const TargetState& target, const Observation& observation);

// Transforms frame a to frame b by a rotation, a uniform scale and a translation (b_from_a).
struct Similarity {
  double scale = 1;
  Quat rotation{1, 0, 0, 0};
  Vec3 translation{0, 0, 0};

  Vec3 operator()(const Vec3& point) const { return scale * (rotation * point) + translation; }
  Pose operator()(const Pose& pose) const {
    return {(*this)(pose.position), glm::normalize(rotation * pose.orientation)};
  }
};

// Weight of an orientation error of one radian in align(), relative to the size of the array. It is so small that the
// camera centres determine the result.
inline constexpr double kRotationWeight = 1e-3;

double spread(const std::vector<Vec3>& points);  // RMS distance from the mean

// Returns the similarity that transforms the poses `a` so that they fit the poses `b` best, in the sense of least
// squares over the camera centres (Umeyama 1991). a[i] corresponds to b[i], and at least two poses are required. If
// `fixed_scale` is true, the scale is 1.
Similarity align(const std::vector<Pose>& a, const std::vector<Pose>& b, bool fixed_scale = false);

// The precision of the cameras after adjust(), as a covariance matrix. It is the inverse of the information matrix of
// observations and priors, after eliminating light positions and batch means. At the true parameters this is the
// Cramer-Rao bound, the smallest possible covariance. The covariance depends on the coordinate system (gauge). Here,
// align() has aligned the scene with the true camera centres.
//
// The parameters of a used camera are its rotation about the world axes (radians), its position (units of the scene),
// and the free lens terms.
struct Uncertainty {
  std::vector<int> camera_row;  // first row of each camera; -1: not used
  int camera_size = 0;          // number of rows per camera
  std::vector<int> lens_terms;  // lens terms in rows 6 and up of each camera
  Eigen::MatrixXd covariance;
  // Covariance of the lens terms before the calibration, with lens_terms.size() rows per camera.
  Eigen::MatrixXd prior_covariance;
  // Standard deviations of the clock terms of each camera; empty unless clocks were adjusted. Offsets and drifts are
  // relative to the mean of all cameras.
  std::vector<std::array<double, 3>> clock_sigmas;

  double sigma_of(const Eigen::VectorXd& weights) const { return std::sqrt(weights.dot(covariance * weights)); }
};

// If `clocks` is not null, the clocks are unknown, too, as in adjust().
Uncertainty estimate_uncertainty(const Reconstruction& scene, const std::vector<Observation>& observations,
                                 const Inliers& use, const AdjustmentOptions& options,
                                 const ClockAdjustment* clocks = nullptr);

// The covariance of a camera's parameters, as stored in the member "covariance" of a camera in a rig file:
//   {"parameters": ["f", "cx", "cy", "k1", "k2", "x", "y", "z", "rx", "ry", "rz"], "matrix": [[...], ...]}
// f, cx and cy are in pixels; k1 to k4, p1 and p2 are as in the lens. x, y and z are the position in metres, and rx, ry
// and rz are rotations about the world axes in radians. Parameters that were not estimated are absent.
struct CameraCovariance {
  std::vector<std::string> parameters;
  std::vector<double> matrix;  // row by row, parameters.size() squared values

  double at(size_t row, size_t column) const { return matrix[row * parameters.size() + column]; }
  std::optional<size_t> index_of(const std::string& parameter) const;
};

// Parses the covariance of `camera`, an element of "cameras" in a rig file. Returns nullopt if it is absent or empty.
// Throws Error with the place unless the matrix has the right size and is symmetric and positive semidefinite.
std::optional<CameraCovariance> parse_camera_covariance(const JsonValue& camera);
nlohmann::ordered_json to_json(const CameraCovariance& covariance);

}  // namespace lf
