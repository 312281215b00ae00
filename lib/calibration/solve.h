// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "calibration/adjustment.h"

namespace lf {

// Free distortion parameters of the cameras.
struct DistortionModel {
  int terms = 0;            // number of radial terms; 1: k1, 2: k1 and k2
  bool shared = false;      // radial terms are about equal in all cameras
  bool tangential = false;  // free p1 and p2 per camera, because lens decentring is random
  bool operator==(const DistortionModel&) const = default;
  std::string name() const;
};

struct ModelTrial {
  std::string model;
  double bic = 0;  // Bayesian information criterion; lower is better
  // RMS error of held-out observations, pixels; nullopt if the BIC rejects the model.
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
  Inliers inliers;       // per observation
  double sigma = 0;      // standard deviation of the inliers in x and y, pixels
  // Per camera, noise relative to the median camera: above 1 for noisy cameras with tracks of a light, otherwise 1.
  std::vector<double> camera_noise;
  double expected_rms = 0;  // RMS residual length expected from the median residual, pixels
  AdjustmentOptions model;
  DistortionModel distortion;
  std::vector<ModelTrial> trials;          // empty if nothing was selected
  std::string start;                       // method of the first layout
  Uncertainty uncertainty;                 // in the solver's frame and scale
  double disagreement = 0;                 // disagreement_of_halves(); 0: not compared
  std::vector<size_t> contradicted_poses;  // cameras that contradict the covariance of the prior rig
};

// Estimates poses, lenses and targets from tracks, up to the gauge. Throws Error if there is no solution.
Solution solve_tracks(const Tracks& tracks, const SolveOptions& options);

// Sets the free and the shared lens terms of a distortion model.
void apply_model(const DistortionModel& model, AdjustmentOptions& options);

// Fits `scene` under each distortion model, from none to two terms per camera. Selects a larger model only if both the
// Bayesian information criterion and the error of held-out observations improve. `scene` becomes the selected fit.
// `tracks` may be a representative sample of `num_observations`; the criterion refers to that number.
struct ModelChoice {
  DistortionModel model;
  std::vector<ModelTrial> trials;
};
ModelChoice choose_distortion(Reconstruction& scene, const Tracks& tracks, const AdjustmentOptions& options,
                              size_t num_observations);

// Decides with the same criteria if p1 and p2 are estimated in addition to `model`. `options` and `scene` are the terms
// and the fit of `model`.
bool choose_tangential(Reconstruction& scene, const Tracks& tracks, const DistortionModel& model,
                       const AdjustmentOptions& options, size_t num_observations, std::vector<ModelTrial>& trials);

// Decides with the same criteria if focal lengths and principal points are equal in all cameras. Sets `options` and
// appends to `trials`. `options` must have the lens terms of the selected distortion model.
void choose_shared_terms(Reconstruction& scene, const Tracks& tracks, AdjustmentOptions& options,
                         std::vector<ModelTrial>& trials);

}  // namespace lf
