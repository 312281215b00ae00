// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "calibration/adjustment.h"

namespace lf {

// Lengths of all residuals in pixels, over the observations' own sigmas, one an observation: negative where there is
// none (an unused camera, no target).
std::vector<double> residual_lengths(const Scene& scene, const std::vector<Observation>& observations);

// Sigma of x and of y from the median of the lengths (that of a Rayleigh distribution), whatever a half of them is.
double robust_sigma(std::vector<double> lengths);

// Those within `reach` sigmas.
Inliers within(const std::vector<double>& lengths, double reach, double sigma);

}  // namespace lf
