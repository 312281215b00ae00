// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "calibration/solve.h"

namespace lf {

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
