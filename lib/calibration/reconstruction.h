// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "calibration/solve.h"

namespace lf {

// Returns a scene to start a calibration from: cameras with lenses and priors of the prior rig, or with defaults.
// Throws Error if the prior rig lacks a camera of the tracks, or if image sizes differ.
Reconstruction make_scene(const Tracks& tracks, const SolveOptions& options);

bool has_known_poses(const SolveOptions& options);

// Adds the measured poses of the prior rig (with covariances) to the scene as priors. The scene moves into the frame of
// the prior rig, relative to its first camera, and into metres unless a bar is the unit of length. Poses that
// contradict the scene and its `uncertainty` are left out and returned. Nothing happens with fewer than three known
// poses, because these do not define a frame.
struct PosePriorResult {
  bool any = false;
  std::vector<size_t> contradicted;
};
PosePriorResult use_pose_priors(Reconstruction& scene, const Tracks& tracks, const SolveOptions& options,
                                const Uncertainty& uncertainty);

}  // namespace lf
