// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "rig/rig.h"

namespace lf {

// Distances between cameras, in metres; 0 for fewer than two. Faster than all pairs: rigs may have 65,535 cameras.

// The largest distance between two cameras, to 1e-9 of it.
double largest_distance(const Rig& rig);
// The mean over all cameras of the distance to the nearest other one.
double mean_nearest_distance(const Rig& rig);

// The axis (0 to 2) along which the cameras extend farthest.
int widest_axis(const Rig& rig);

}  // namespace lf
