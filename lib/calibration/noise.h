// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "calibration/adjustment.h"

namespace lf {

// Returns how far each observation is from its prediction, in units of its standard deviation (sigma): the length of
// the residual in pixels, divided by the sigma. The value is negative if there is no residual, because the camera is
// unused or the position of the light is unknown.
std::vector<double> residual_lengths(const Reconstruction& scene, const std::vector<Observation>& observations);

// Estimates the noise of the observations: the standard deviation of x and y, from the median length of the residuals.
double robust_sigma(std::vector<double> lengths);

inline constexpr double kOutlier = 3.8;  // limit for inliers, in sigmas; 1 of 1,400 correct observations exceeds it

// Marks observations with residuals of up to `reach` sigmas as inliers.
Inliers within(const std::vector<double>& lengths, double reach, double sigma);

// Excludes cameras that the scene does not determine well: with fewer than four observations, or with fewer than 30 %
// of them within `reach` pixels.
void drop_poor_cameras(Reconstruction& scene, const std::vector<Observation>& observations, double reach);

// Returns the sigma of the measurements from the lengths of inliers. It is corrected for the parameters that were
// fitted to the same observations. `uncertainty` belongs to the scene, and is empty if not yet known.
double inlier_sigma(const Reconstruction& scene, const std::vector<Observation>& observations,
                    const std::vector<double>& lengths, const Inliers& inliers, const AdjustmentOptions& model,
                    const Uncertainty& uncertainty);

// Compares the noise of the cameras: returns the size of each camera's residuals relative to the median camera. A ratio
// below 2 counts as 1, because it may be chance; so does the ratio of a camera with too few observations. The result is
// at most 4, because larger residuals are outliers.
std::vector<double> noise_of_cameras(const Reconstruction& scene, const std::vector<Observation>& observations);

// Fits light positions with fewer than three inliers to all of their observations, so that residuals in reports are
// unbiased. Observations within kOutlier of `sigma` then become inliers. `weight` is the sigma of the observations in
// this fit.
void retriangulate_weak_targets(Reconstruction& scene, const Tracks& tracks, double weight, double sigma,
                                Inliers& inliers);

// Sets the sigma of the observations of each track from the track's residuals, relative to the median track. For short
// tracks, the median acts as a prior.
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
