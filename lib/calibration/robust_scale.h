// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "calibration/adjustment.h"

namespace lf {

// Lengths of all residuals in pixels, over the observations' own sigmas, one an observation: negative where there is
// none (an unused camera, no target).
std::vector<double> residual_lengths(const Reconstruction& scene, const std::vector<Observation>& observations);

// Sigma of x and of y from the median of the lengths (that of a Rayleigh distribution), whatever a half of them is.
double robust_sigma(std::vector<double> lengths);

// Those within `reach` sigmas.
Inliers within(const std::vector<double>& lengths, double reach, double sigma);

// Feature tracks are not alike: one follows a printed corner to three hundredths of a pixel, another an edge, the rim
// of something round or a highlight to a half. Sets the sigma of all observations of a track to what its residuals
// show, over that of the median track; few residuals are helped by that median.
void estimate_track_noise(const Reconstruction& scene, Tracks& tracks);

}  // namespace lf
