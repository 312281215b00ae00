// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "calibration/report.h"

namespace lf {

// Whether things moved between the pictures that feature tracks are of.
struct MovingScene {
  double share = 0;     // the share, of tracks that five cameras see, of those that moved
  double taken_in = 0;  // the share that moved of the tracks that the solution relies on
  double shift_px = 0;  // root of the mean square of what cameras see them off by
};

// What moves is seen the farther along its way the later a camera's picture was taken: residuals of a track are one
// direction times one number a camera, and these numbers are the same for all tracks. They are the first eigenvector of
// what the cameras' residuals have in common; a camera that is wrong by itself is no such number, and is left out.
MovingScene find_motion(const Solution& solution, const Tracks& tracks);

// What a person must know before trusting a solution, each finding by a name of its own:
//   dead-camera, camera-not-found, disconnected-groups, late-camera (its tracks fit when moved by whole frames),
//   swapped-cameras (against the prior rig's layout), many-outliers, noisy-camera,
//   unknown-focal-length, unknown-principal-point, unknown-k1, unknown-k2, unknown-p1, unknown-p2 (no better known than
//   before), soft-depth, soft-positions, soft-rotations, halves-disagree, moving-scene, prior-contradicted, no-scale,
//   odd-scale.
std::vector<Finding> diagnose(const Solution& solution, const Tracks& tracks, const SolveOptions& options,
                              const Placement& placement);

}  // namespace lf
