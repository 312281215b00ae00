// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "calibration/adjustment.h"

namespace lf {

// These find first poses and targets without any guess of them. The lenses are those in the scene; cameras that could
// not be placed are left unused.

// Places an array whose cameras look about the same way from about a plane. Returns the share of the sights that fit.
double layout_from_disparities(Reconstruction& scene, const Tracks& tracks);

// Places the cameras of any rig: by essential matrices of many pairs, their rotations averaged, then all places at once
// from the lines of sight; then cameras that this missed, from what the others see. Returns how many were placed.
int layout_from_averages(Reconstruction& scene, const Tracks& tracks, double threshold);

// Places the cameras of any rig: the best pair by its essential matrix, then one camera after the other from what those
// see. Returns how many were placed.
int layout_from_a_pair(Reconstruction& scene, const Tracks& tracks, double threshold);

// Places targets for poses that are there already, with bars made of unit length where the tracks have bars.
void targets_from_poses(Reconstruction& scene, const Tracks& tracks, double threshold);

// Places unused cameras from the targets that they see. Returns how many were placed.
int resect_cameras(Reconstruction& scene, const Tracks& tracks, double threshold);

}  // namespace lf
