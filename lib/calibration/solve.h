// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "calibration/adjustment.h"

namespace lf {

// How many radial terms, whether all cameras have the same, and whether p1 and p2 are free, too.
struct DistortionModel {
  int terms = 0;            // 0, 1: k1, 2: k1 and k2
  bool shared = false;      // about the same in all cameras
  bool tangential = false;  // each camera has p1 and p2 of its own, as lenses stand askew by chance
  bool operator==(const DistortionModel&) const = default;
  std::string name() const;
};

// One model of distortion that was tried.
struct ModelTrial {
  std::string model;
  double bic = 0;  // Bayesian information criterion: less is better
  // Rms error of observations held out, pixels; nothing where the BIC already speaks against the model.
  std::optional<double> transfer_px;
  bool chosen = false;
};

struct SolveOptions {
  std::optional<Rig> prior;                                        // nominal lenses and layout; cameras are found by id
  std::vector<std::optional<CameraCovariance>> prior_covariances;  // for each camera of the prior rig; may be empty
  std::optional<DistortionModel> distortion;                       // nothing: chosen by evidence
  std::function<void(const std::string& step)> progress;           // called before each step; may throw to cancel
};

struct Solution {
  Reconstruction scene;  // cameras and targets in the scale and frame of the solver: see align()
  Inliers inliers;       // which observations count, a value for each
  double sigma = 0;      // estimated standard deviation of the inliers in x and in y, pixels
  // For each camera its noise over that of most, where it errs more in a light's tracks; else 1.
  std::vector<double> camera_noise;
  double expected_rms = 0;  // rms of residuals' lengths if all were noise like their middle half, pixels
  AdjustmentOptions model;  // which lens terms are free
  DistortionModel distortion;
  std::vector<ModelTrial> trials;  // empty where nothing was to be chosen
  std::string start;               // how the first layout was found
  Uncertainty uncertainty;         // uncertainty in the solver's frame and scale
  double disagreement = 0;         // how far halves of the tracks disagree (disagreement_of_halves()); 0: not compared
  std::vector<size_t> contradicted_poses;  // cameras that are not where the prior rig's covariance allows
};

// Everything but the frame: poses, lenses and targets from tracks. Throws Error where nothing can be found at all.
Solution solve_tracks(const Tracks& tracks, const SolveOptions& options);

// The lens terms that are free under a model of distortion, and those that cameras share.
void apply_model(const DistortionModel& model, AdjustmentOptions& options);

// Fits `scene` under each model, from none to two terms a camera, and takes the one that the tracks call for: a larger
// model only where both the Bayesian information criterion and the error of observations held out improve on the
// best so far. `scene` becomes the chosen fit. `tracks` may be a part of `num_observations` like them, for which the
// criterion is.
struct ModelChoice {
  DistortionModel model;
  std::vector<ModelTrial> trials;
};
ModelChoice choose_distortion(Reconstruction& scene, const Tracks& tracks, const AdjustmentOptions& options,
                              size_t num_observations);

// Decides, as choose_distortion() does, whether p1 and p2 are free beside `model`, whose terms `options` has and whose
// fit `scene` is.
bool choose_tangential(Reconstruction& scene, const Tracks& tracks, const DistortionModel& model,
                       const AdjustmentOptions& options, size_t num_observations, std::vector<ModelTrial>& trials);

// Decides, as choose_distortion() does, whether the focal lengths, and the principal points, of all cameras are about
// the same: sets that in `options`, whose lens terms are those of the distortion chosen, and adds to `trials`.
void choose_alike(Reconstruction& scene, const Tracks& tracks, AdjustmentOptions& options,
                  std::vector<ModelTrial>& trials);

}  // namespace lf
