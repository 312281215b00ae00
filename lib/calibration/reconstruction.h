// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "calibration/solve.h"

namespace lf {

// Returns an initial scene: lenses and priors from the prior rig, or defaults. Throws Error if the prior rig lacks a
// camera of the tracks, or if image sizes differ.
Reconstruction make_scene(const Tracks& tracks, const SolveOptions& options);

bool has_known_poses(const SolveOptions& options);

// Adds pose priors from the prior rig's covariances to the scene. Moves the scene into the prior rig's frame, relative
// to its first camera, and to metres unless a bar is the unit of length. Poses that contradict the scene and its
// `uncertainty` are left out and returned. Does nothing with fewer than three known poses, which do not define a frame.
struct PosePriorResult {
  bool any = false;
  std::vector<size_t> contradicted;
};
PosePriorResult use_pose_priors(Reconstruction& scene, const Tracks& tracks, const SolveOptions& options,
                                const Uncertainty& uncertainty);

}  // namespace lf
