// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "calibration/solve.h"

namespace lf {

// A scene before anything is measured: lenses from the prior rig or as usual, with what is known of them. Throws Error
// where the prior rig lacks a camera of the tracks or has it in another size.
Reconstruction make_scene(const Tracks& tracks, const SolveOptions& options);

bool knows_poses(const SolveOptions& options);

// Lets what the prior rig's covariances say of poses take part in the scene's adjustment, and moves the scene into that
// rig's frame, relative to its first camera (and into metres, where no bar is its unit of length). Poses that the
// scene, by its `uncertainty`, contradicts are left out: returns those cameras. Does nothing where fewer than three
// cameras have a known pose, which is no frame.
struct PosePriorUse {
  bool any = false;
  std::vector<size_t> contradicted;
};
PosePriorUse use_pose_priors(Reconstruction& scene, const Tracks& tracks, const SolveOptions& options,
                             const Uncertainty& uncertainty);

}  // namespace lf
