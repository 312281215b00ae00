// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "calibration/adjustment.h"

namespace lf {

// Returns the residual lengths in pixels, divided by the observations' sigmas; negative if there is no residual (unused
// camera, no target).
std::vector<double> residual_lengths(const Reconstruction& scene, const std::vector<Observation>& observations);

// Returns the sigma of x and y from the median length (Rayleigh distribution); tolerates up to half outliers.
double robust_sigma(std::vector<double> lengths);

inline constexpr double kOutlier = 3.8;  // sigmas; exceeded by 1 of 1,400 correct observations

// Marks observations with residuals up to `reach` sigmas as inliers.
Inliers within(const std::vector<double>& lengths, double reach, double sigma);

// Disables cameras with fewer than 30 % of their observations within `reach` pixels, or fewer than four observations.
void drop_poor_cameras(Reconstruction& scene, const std::vector<Observation>& observations, double reach);

// Returns the measurement sigma from the lengths of inliers, corrected for the degrees of freedom of the parameters.
// `uncertainty`: of the scene; empty if not yet known.
double inlier_sigma(const Reconstruction& scene, const std::vector<Observation>& observations,
                    const std::vector<double>& lengths, const Inliers& inliers, const AdjustmentOptions& model,
                    const Uncertainty& uncertainty);

// Returns each camera's residuals relative to the median camera: 1 if the ratio is below 2 or observations are too few;
// at most 4, because larger residuals are outliers.
std::vector<double> noise_of_cameras(const Reconstruction& scene, const std::vector<Observation>& observations);

// Adjusts targets with fewer than three inliers to all of their observations, for unbiased residuals in reports. Then
// observations within kOutlier of `sigma` become inliers. `weight`: sigma of the observations in this adjustment.
void retriangulate_weak_targets(Reconstruction& scene, const Tracks& tracks, double weight, double sigma,
                                Inliers& inliers);

// Sets the sigma of each track's observations from its residuals, relative to the median track. Printed corners are
// tracked to three hundredths of a pixel; edges, round contours and highlights only to half a pixel. The median acts as
// a prior for short tracks.
void estimate_track_noise(const Reconstruction& scene, Tracks& tracks);

// Solves two halves of the tracks separately, starting from `scene`. Returns the RMS difference of the cameras, in
// standard deviations predicted by estimate_uncertainty(). The value is about 1 if errors are independent. A larger
// value means that errors are correlated within parts of the tracks, and that all standard deviations are too small by
// that factor. Neighbouring features belong to the same half (alternating blocks of the start image, or of a light's
// path), because their errors are correlated. Errors common to both halves are not detected.
double disagreement_of_halves(const Reconstruction& scene, const Tracks& tracks, const Inliers& use,
                              const AdjustmentOptions& options);

}  // namespace lf
