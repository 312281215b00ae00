// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "calibration/report.h"

namespace lf {

// Scene motion between the images that feature tracks come from.
struct MovingScene {
  double share = 0;       // moving share of the tracks in at least five cameras
  double used_share = 0;  // moving share of the tracks that the solution relies on
  double shift_px = 0;    // RMS displacement of the moving tracks, pixels
};

// Detects tracks that move. The displacement of a moving point grows with a camera's capture time: its residuals are
// one direction times one number per camera, and these numbers are the same for all tracks. They form the first
// eigenvector of the residual products of all cameras. Cameras with large independent errors are excluded.
MovingScene find_motion(const Solution& solution, const Tracks& tracks);

// Returns the problems of a solution. Codes:
//   dead-camera, camera-not-found, disconnected-groups, late-camera (its tracks fit when moved by whole frames),
//   swapped-cameras (against the prior rig's layout), many-outliers, noisy-camera,
//   unknown-focal-length, unknown-principal-point, unknown-k1, unknown-k2, unknown-p1, unknown-p2 (uncertainty not
//   reduced), soft-depth, soft-positions, soft-rotations, halves-disagree, moving-scene, prior-contradicted, no-scale,
//   odd-scale.
std::vector<Finding> diagnose(const Solution& solution, const Tracks& tracks, const SolveOptions& options,
                              const Placement& placement);

}  // namespace lf
