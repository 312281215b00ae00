// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "calibration/report.h"

namespace lf {

// What a person must know before trusting a solution, each finding by a name of its own:
//   dead-camera, camera-not-found, disconnected-groups, late-camera (its tracks fit when moved by whole frames),
//   swapped-cameras (against the prior rig's layout), many-outliers, noisy-camera,
//   unknown-focal-length, unknown-principal-point, unknown-k1, unknown-k2, unknown-p1, unknown-p2 (no better known than
//   before), soft-depth, soft-positions, soft-rotations, halves-disagree, moving-scene, prior-contradicted, no-scale,
//   odd-scale.
std::vector<Finding> diagnose(const Solution& solution, const Tracks& tracks, const SolveOptions& options,
                              const Placement& placement);

}  // namespace lf
