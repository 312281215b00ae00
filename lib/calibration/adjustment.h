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

// The lens parameters that calibration can set, in this order everywhere. The rest (fy/fx) stays as given.
enum LensTerm { kF, kCx, kCy, kK1, kK2, kP1, kP2, kNumLensTerms };
// The names of lens terms in covariances.
inline constexpr const char* kLensTermNames[kNumLensTerms] = {"f", "cx", "cy", "k1", "k2", "p1", "p2"};

// One camera while it is being measured: a flat block of parameters, world_from_camera, then the lens.
struct CameraState {
  static constexpr int kSize = 7 + kNumLensTerms;
  std::array<double, kSize> v{1, 0, 0, 0, 0, 0, 0, 1};  // w x y z, position, f cx cy k1 k2 p1 p2
  double aspect = 1;                                    // fy / fx: never changed
  int width = 0, height = 0;
  bool used = false;  // takes part: the camera sees enough of what others see

  Pose pose() const { return {{v[4], v[5], v[6]}, {v[0], v[1], v[2], v[3]}}; }
  void set_pose(const Pose& pose);
  double* lens_terms() { return v.data() + 7; }
  const double* lens_terms() const { return v.data() + 7; }
  // The lens as RADIAL, or as OPENCV where p1 or p2 are not 0.
  Lens lens() const;
  void set_lens(const Lens& lens);
};

// One place of the light: a point; or the middle of a bar and its direction, a unit vector (the bar's length is the
// unit of length then).
struct TargetState {
  enum class Kind : uint8_t { kNone, kPoint, kBar };
  std::array<double, 6> v{};
  Kind kind = Kind::kNone;
  uint32_t light = 0;  // which light of a bar this is, where the target is a point

  bool has(uint32_t which) const { return kind == Kind::kBar || (kind == Kind::kPoint && light == which); }
  Vec3 point(uint32_t which) const;
};

// What is known of a lens before: its terms and the square root of their information (upper rows; W (lens - mean) has
// unit covariance). Rows and columns of terms that nothing is known of are zero: they have the batch's prior.
struct LensPrior {
  std::array<double, kNumLensTerms> mean{};
  std::array<double, kNumLensTerms * kNumLensTerms> root_information{};  // row by row
  std::array<bool, kNumLensTerms> known{};
};

// What is known of a pose before: x, y, z and a turn about the world's axes, as a rig's covariance counts them, in the
// frame and the metres of the rig that says so. Rows and columns of terms that nothing is known of are zero.
struct PosePrior {
  static constexpr int kNumTerms = 6;
  Pose mean;
  std::array<double, kNumTerms * kNumTerms> root_information{};
};

// Lenses of one batch are alike: each is within `spread` of the batch's mean, or within `tight` where the term is said
// to be the same in all; the mean is within `width` of `mean`. All of them one sigma.
struct BatchPrior {
  std::array<double, kNumLensTerms> mean{}, width{}, spread{}, tight{};
};

struct Reconstruction {
  std::vector<CameraState> cameras;
  std::vector<TargetState> targets;                   // one for each position of the light
  std::vector<std::optional<LensPrior>> lens_priors;  // per camera; cameras without one have the batch's
  BatchPrior batch;
  std::array<double, kNumLensTerms> batch_mean{};  // the batch's mean, as estimated
  // What is known of poses, per camera, or empty: only once the scene is in the frame that they are given in.
  std::vector<std::optional<PosePrior>> pose_priors;
  double metres = 1;  // metres in a unit of the scene: estimated where a bar is the unit

  // Whether the term was measured before in this camera (else it has the batch's prior), or in any camera.
  bool measured(size_t camera, int term) const { return lens_priors[camera] && lens_priors[camera]->known[term]; }
  bool measured(int term) const;
  // How far the term may be from the batch's mean, one sigma.
  double spread(int term, bool shared) const { return shared ? batch.tight[term] : batch.spread[term]; }
};

struct AdjustmentOptions {
  std::array<bool, kNumLensTerms> free{};    // lens terms
  std::array<bool, kNumLensTerms> shared{};  // which free terms are alike in all cameras that had none measured
  double sigma = 1;                          // standard deviation of an observation's x and of its y, pixels
  double robust = 0;                         // beyond this many sigmas an error counts less; 0: least squares
  bool redescending = true;                  // such an error counts less and less (Cauchy), or by its length (Huber)
  int max_iterations = 50;
  double tolerance = 1e-9;  // relative change of the cost at which it ends
  double trust = 1e4;       // first radius of the trust region; more where the start is good: soft modes are long
  bool free_poses = true, free_targets = true;
};

struct AdjustmentSummary {
  bool ok = false;
  double cost = 0;
  int iterations = 0;
};

// Whether observations take part, one value for each.
using Inliers = std::vector<char>;

// Clocks that are adjusted with the scene: an observation whose clock is late shows its light where it was then.
struct ClockAdjustment {
  // What is to be added to one camera's clock, seconds: `terms` are an offset, a drift (seconds a second, about the
  // stamp `middle`), and what comes on top from the stamp `step_at` on, where that is finite.
  struct Camera {
    std::array<double, 3> terms{};
    double middle = 0, step_at = std::numeric_limits<double>::infinity();
    std::array<double, 3> by(double stamp) const { return {1, stamp - middle, stamp >= step_at ? 1.0 : 0.0}; }
  };
  std::vector<Camera> cameras;
  std::vector<Vec2> velocity;  // for each observation: how fast its light moves, pixels a second
  std::vector<double> stamp;   // for each observation: the camera's stamp, seconds
};

// Bundle adjustment over the observations with use[i] of cameras that are used and targets that have that light. With
// `clocks` these are free, too: what they have in common, nothing tells but weak priors.
AdjustmentSummary adjust(Reconstruction& scene, const std::vector<Observation>& observations, const Inliers& use,
                         const AdjustmentOptions& options, ClockAdjustment* clocks = nullptr);

// How far an observation is, in pixels, from where `target` should appear in `camera`; nothing where it is behind the
// camera.
std::optional<Vec2> residual(const CameraState& camera, const TargetState& target, const Observation& observation);

// b_from_a between two frames: rotation, uniform scale and shift.
struct Similarity {
  double scale = 1;
  Quat rotation{1, 0, 0, 0};
  Vec3 translation{0, 0, 0};

  Vec3 operator()(const Vec3& point) const { return scale * (rotation * point) + translation; }
  Pose operator()(const Pose& pose) const {
    return {(*this)(pose.position), glm::normalize(rotation * pose.orientation)};
  }
};

// How much a radian counts beside a distance of the size of the array: nearly nothing, so that alignment is that of the
// centres; but where these leave a turn open (cameras in one row, or two) the orientations decide.
inline constexpr double kTurnWeight = 1e-3;

// The root of the mean squared distance from the mean.
double spread(const std::vector<Vec3>& points);

// The similarity that takes poses `a` nearest to poses `b` (least squares of the centres: Umeyama 1991). Pairs by
// index; two at least. `fixed_scale`: scale 1.
Similarity align(const std::vector<Pose>& a, const std::vector<Pose>& b, bool fixed_scale = false);

// How well the cameras of an adjusted scene are known: the inverse of the information in the observations and the
// priors, targets and batch means eliminated, so that it is also the bound (Cramer, Rao) for any unbiased method when
// taken at the truth. In the gauge of a scene that has been aligned by a similarity with the true centres (align()).
//
// Steps of a used camera: rotation about the world's axes (radians), position (units of the scene), free lens terms.
struct Uncertainty {
  std::vector<int> camera_row;  // first row of each camera; -1: not used
  int camera_size = 0;          // rows of each
  std::vector<int> lens_terms;  // lens terms that a camera's rows from the seventh on are of
  Eigen::MatrixXd covariance;   // of the steps of all cameras
  // Covariance of the lens terms as known before, lens_terms.size() rows for each camera.
  Eigen::MatrixXd prior_covariance;

  // A functional of all steps: its standard deviation.
  double sigma_of(const Eigen::VectorXd& weights) const { return std::sqrt(weights.dot(covariance * weights)); }
};

Uncertainty estimate_uncertainty(const Reconstruction& scene, const std::vector<Observation>& observations,
                                 const Inliers& use, const AdjustmentOptions& options);

// How well a camera's parameters are known: the member "covariance" of a camera in a rig file,
//   {"parameters": ["f", "cx", "cy", "k1", "k2", "x", "y", "z", "rx", "ry", "rz"], "matrix": [[...], ...]}
// f, cx, cy in pixels; k1, k2, p1, p2 as in the lens; x, y, z the position in metres; rx, ry, rz in radians: the
// rotation, about the world's axes, by which the true orientation may differ. Any of them may be absent (a parameter
// that was not estimated).
struct CameraCovariance {
  std::vector<std::string> parameters;
  std::vector<double> matrix;  // row by row, parameters.size() squared

  double at(size_t row, size_t column) const { return matrix[row * parameters.size() + column]; }
  std::optional<size_t> index_of(const std::string& parameter) const;
};

// `camera` is an element of a rig file's "cameras". Nothing where it has no (or an empty) covariance. Throws Error
// naming the place where it is not a symmetric positive semidefinite matrix of the right size.
std::optional<CameraCovariance> parse_camera_covariance(const JsonValue& camera);
nlohmann::ordered_json to_json(const CameraCovariance& covariance);

}  // namespace lf
