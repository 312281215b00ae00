// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "calibration/adjustment.h"

namespace lf {

// Returns the lengths of the residuals in pixels, divided by the sigmas of the observations. The length is negative if
// there is no residual (unused camera, unknown light position).
std::vector<double> residual_lengths(const Reconstruction& scene, const std::vector<Observation>& observations);

// Returns the sigma of x and y, from the median length of a Rayleigh distribution. Up to half of the lengths may be
// outliers.
double robust_sigma(std::vector<double> lengths);

inline constexpr double kOutlier = 3.8;  // limit for inliers, in sigmas; 1 of 1,400 correct observations exceeds it

// Marks observations with residuals of up to `reach` sigmas as inliers.
Inliers within(const std::vector<double>& lengths, double reach, double sigma);

// Stops using cameras with fewer than four observations, or with fewer than 30 % of them within `reach` pixels.
void drop_poor_cameras(Reconstruction& scene, const std::vector<Observation>& observations, double reach);

// Returns the sigma of the measurements from the lengths of inliers. It is corrected for the parameters that were
// fitted to the same observations. `uncertainty` belongs to the scene, and is empty if not yet known.
double inlier_sigma(const Reconstruction& scene, const std::vector<Observation>& observations,
                    const std::vector<double>& lengths, const Inliers& inliers, const AdjustmentOptions& model,
                    const Uncertainty& uncertainty);

// Returns how large the residuals of each camera are, relative to the median camera. The result is 1 if the ratio is
// below 2 or if there are too few observations. It is at most 4, because larger residuals are outliers.
std::vector<double> noise_of_cameras(const Reconstruction& scene, const std::vector<Observation>& observations);

// Fits light positions with fewer than three inliers to all of their observations, so that residuals in reports are
// unbiased. Observations within kOutlier of `sigma` then become inliers. `weight` is the sigma of the observations in
// this fit.
void retriangulate_weak_targets(Reconstruction& scene, const Tracks& tracks, double weight, double sigma,
                                Inliers& inliers);

// Sets the sigma of the observations of each track from the track's residuals, relative to the median track. Tracks
// differ much: printed corners are tracked to three hundredths of a pixel, but edges, round contours and highlights
// only to half a pixel. For short tracks, the median acts as a prior.
void estimate_track_noise(const Reconstruction& scene, Tracks& tracks);

// Tests whether the predicted standard deviations can be trusted. Solves two halves of the tracks separately, starting
// from `scene`, and returns the RMS difference of the cameras, in standard deviations predicted by
// estimate_uncertainty().
//
// The result is about 1 if errors are independent. A larger value means that errors are correlated within parts of the
// tracks, and that all standard deviations are too small by this factor. Neighbouring features have correlated errors,
// so they belong to the same half: alternating blocks of the start image, or of a light's path. Errors that both halves
// have in common are not detected.
double disagreement_of_halves(const Reconstruction& scene, const Tracks& tracks, const Inliers& use,
                              const AdjustmentOptions& options);

}  // namespace lf
