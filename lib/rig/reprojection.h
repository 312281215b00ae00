// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "rig/rig.h"

namespace lf {

// How far apart two descriptions of the same cameras are, in pixels: the largest distance between where camera i of `b`
// and camera i of `a` see the same point, over 9 x 9 points of each image of `a`, at `distance` metres along the axis
// and far away. Infinity if the numbers of cameras differ or `b` does not see a point.
double max_reprojection_error(const Rig& a, const Rig& b, double distance);

}  // namespace lf
