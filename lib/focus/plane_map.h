// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "geometry/focal_surface.h"
#include "view/view.h"

namespace lf {

// Where a line of sight (view coordinates) meets the viewer's focal plane, as inverse distance from `from` along its
// normal; 0 if it does not.
double plane_inverse(const View& view, const Plane& from, const Vec3& ray);

// The viewer's focal plane as a map between two inverse distances (1/m, farthest < nearest), clamped to them. Nodes are
// as those of the view's map, or without one `step` pixels apart.
FocalMap plane_map(const View& view, const Plane& from, double nearest, double farthest,
                   int step = FocalMap::kFinestStep);

}  // namespace lf
