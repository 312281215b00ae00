// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "calibration/adjustment.h"

namespace lf {

// Solves two halves of the tracks on their own, starting from `scene`, and compares the cameras: the root of the mean
// squared difference, in standard deviations that estimate_uncertainty() predicts for it. About 1 where errors are what
// they are taken for, independent of each other; more where they are alike in parts of the tracks: then all standard
// deviations are too small by that factor. Neighbouring features come into the same half (alternating blocks of the
// image that they start in, or of the path of a light), since what they share is what makes them err together. Errors
// that both halves share can't be seen by it.
double disagreement_of_halves(const Reconstruction& scene, const Tracks& tracks, const Inliers& use,
                              const AdjustmentOptions& options);

}  // namespace lf
