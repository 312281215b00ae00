// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "calibration/adjustment.h"

namespace lf {

struct DistortionModel {
  int terms = 0;            // number of radial terms: 0, 1 (k1) or 2 (k1 and k2)
  bool shared = false;      // radial terms are about equal in all cameras
  bool tangential = false;  // p1 and p2 are estimated for each camera, because lenses are decentred at random
  bool operator==(const DistortionModel&) const = default;
  std::string name() const;
};

struct ModelTrial {
  std::string model;
  double bic = 0;
  // RMS error of observations left out of the fit, pixels; nullopt if the BIC already rejects the model.
  std::optional<double> transfer_px;
  bool chosen = false;
};

struct SolveOptions {
  // nominal lenses and layout; cameras are matched by id
  std::optional<Rig> prior;
  std::vector<std::optional<CameraCovariance>> prior_covariances;  // per camera of the prior rig; may be empty
  std::optional<DistortionModel> distortion;                       // nullopt: selected automatically
  std::function<void(const std::string& step)> progress;           // called before each step; may throw to cancel
};

struct Solution {
  Reconstruction scene;  // in the solver's scale and frame, see align()
  Inliers inliers;
  double sigma = 0;  // standard deviation of the inliers in x and y, pixels
  // Noise of each camera relative to the median camera: above 1 for noisy cameras with tracks of a light, otherwise 1.
  std::vector<double> camera_noise;
  double expected_rms = 0;  // RMS residual length that follows from the median residual, pixels
  AdjustmentOptions model;
  DistortionModel distortion;
  std::vector<ModelTrial> trials;  // tested models; empty if the model was given
  std::string start;               // method that gave the first layout; empty if the layout was given
  Uncertainty uncertainty;
  double disagreement = 0;                 // disagreement_of_halves(), or 0 if not computed
  std::vector<size_t> contradicted_poses;  // cameras that contradict the covariance of the prior rig
};

// Estimates poses, lenses and light positions from tracks, without scale and frame (see place_solution()). Throws Error
// if there is no solution.
Solution solve_tracks(const Tracks& tracks, const SolveOptions& options);

// Estimates the same from a first layout: a scene with the poses of cameras and targets and with approximate lenses,
// for example of solve_boards().
Solution solve_from_layout(Reconstruction layout, const Tracks& tracks, const SolveOptions& options);

// Sets which lens terms the solver may change, and which terms all cameras share, according to a distortion model.
void apply_model(const DistortionModel& model, AdjustmentOptions& options);

// Decides how many distortion terms the cameras need. Fits `scene` under each distortion model, from none to two terms
// per camera, and leaves the selected fit in `scene`. A larger model is only selected if it improves both the Bayesian
// information criterion (BIC) and the error of observations that were left out of the fit. To save time, `tracks` may
// be a representative sample; `num_observations` is the number before sampling, and the BIC depends on this number.
struct ModelChoice {
  DistortionModel model;
  std::vector<ModelTrial> trials;
};
ModelChoice choose_distortion(Reconstruction& scene, const Tracks& tracks, const AdjustmentOptions& options,
                              size_t num_observations);

// Decides whether to estimate the tangential distortion p1 and p2 in addition to `model`, with the criteria of the
// function above. `options` and `scene` are the terms and the fit of `model`.
bool choose_tangential(Reconstruction& scene, const Tracks& tracks, const DistortionModel& model,
                       const AdjustmentOptions& options, size_t num_observations, std::vector<ModelTrial>& trials);

// Decides whether all cameras share their focal length and principal point, with the criteria of the functions above.
// Sets `options`, which must have the lens terms of the selected distortion model, and appends to `trials`.
void choose_shared_terms(Reconstruction& scene, const Tracks& tracks, AdjustmentOptions& options,
                         std::vector<ModelTrial>& trials);

}  // namespace lf
