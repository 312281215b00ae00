// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "geometry/plane.h"
#include "rig/rig.h"

namespace lf {

// What focal maps of an array count distances from: through the mean of its centres, normal to the mean of its axes.
// Requires at least one camera; cameras that look in opposite directions give the first one's axis.
Plane array_plane(const Rig& rig);

}  // namespace lf
