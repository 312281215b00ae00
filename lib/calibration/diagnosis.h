// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "calibration/report.h"

namespace lf {

// Motion of the scene between the images that feature tracks come from. A calibration from features assumes that
// nothing moves.
struct MovingScene {
  double share = 0;       // share of the tracks in at least five cameras that move
  double used_share = 0;  // share of the tracks that the solution relies on that move
  double shift_px = 0;    // RMS displacement of the moving tracks, pixels
};

// Detects tracks that move. The displacement of a moving point is proportional to the capture time of each camera, so
// its residuals are one direction times one number per camera. These numbers are the same for all tracks and form the
// first eigenvector of the products of all cameras' residuals. Cameras with large independent errors are excluded.
MovingScene find_motion(const Solution& solution, const Tracks& tracks);

// Returns the problems of a calibration, for the report. Programs can test the following codes:
// dead-camera, camera-not-found, disconnected-groups
// late-camera: the camera's tracks fit if they are moved by whole frames
// swapped-cameras: cameras are at each other's places in the prior rig
// many-outliers, noisy-camera
// unknown-focal-length, unknown-principal-point, unknown-k1, unknown-k2, unknown-p1, unknown-p2: the calibration did
//   not reduce the uncertainty
// soft-depth, soft-positions, soft-rotations, halves-disagree, moving-scene, prior-contradicted, no-scale, odd-scale
std::vector<Finding> diagnose(const Solution& solution, const Tracks& tracks, const SolveOptions& options,
                              const Placement& placement);

}  // namespace lf
