// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "calibration/adjustment.h"

namespace lf {

// Lengths of all residuals in pixels, over the observations' own sigmas, one an observation: negative where there is
// none (an unused camera, no target).
std::vector<double> residual_lengths(const Reconstruction& scene, const std::vector<Observation>& observations);

// Sigma of x and of y from the median of the lengths (that of a Rayleigh distribution), whatever a half of them is.
double robust_sigma(std::vector<double> lengths);

inline constexpr double kOutlier = 3.8;  // sigmas: 1 of 1,400 good ones is beyond

// Marks the observations whose residuals are within `reach` sigmas.
Inliers within(const std::vector<double>& lengths, double reach, double sigma);

// Takes cameras out of use of which less than three tenths of the observations are within `reach` pixels, or that have
// fewer than four.
void drop_poor_cameras(Reconstruction& scene, const std::vector<Observation>& observations, double reach);

// The sigma of what was measured, from the lengths of those within kOutlier: what the free parameters took of it is
// given back. `uncertainty`: of the scene, or empty while it is not known.
double inlier_sigma(const Reconstruction& scene, const std::vector<Observation>& observations,
                    const std::vector<double>& lengths, const Inliers& inliers, const AdjustmentOptions& model,
                    const Uncertainty& uncertainty);

// How many times as much as most cameras each one errs, from its residuals over the observations' sigmas: 1 where that
// is less than twice as much, or where it has too few of them; 4 at most, since what is farther off is wrong.
std::vector<double> noise_of_cameras(const Reconstruction& scene, const std::vector<Observation>& observations);

// Places targets that fewer than three good sights hold amid all of their sights, so that what is reported of these is
// fair, and counts those as inliers that are within kOutlier of `sigma` then. `weight`: the sigma that sights count
// with.
void settle_doubtful_targets(Reconstruction& scene, const Tracks& tracks, double weight, double sigma,
                             Inliers& inliers);

// Feature tracks are not alike: one follows a printed corner to three hundredths of a pixel, another an edge, the rim
// of something round or a highlight to a half. Sets the sigma of all observations of a track to what its residuals
// show, over that of the median track; few residuals are helped by that median.
void estimate_track_noise(const Reconstruction& scene, Tracks& tracks);

// Solves two halves of the tracks on their own, starting from `scene`, and compares the cameras: the root of the mean
// squared difference, in standard deviations that estimate_uncertainty() predicts for it. About 1 where errors are what
// they are taken for, independent of each other; more where they are alike in parts of the tracks: then all standard
// deviations are too small by that factor. Neighbouring features come into the same half (alternating blocks of the
// image that they start in, or of the path of a light), since what they share is what makes them err together. Errors
// that both halves share can't be seen by it.
double disagreement_of_halves(const Reconstruction& scene, const Tracks& tracks, const Inliers& use,
                              const AdjustmentOptions& options);

}  // namespace lf
