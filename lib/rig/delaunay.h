// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>
#include <vector>

#include "rig/predicates.h"
#include "rig/triangle.h"

namespace lf {

// The Delaunay triangulation of `points` (within +-kMaxCoordinate), triangles named by places in `points`.
// Unique: a polygon of cocircular points is split into the fan from its lowest index, of coincident points only the
// lowest index is used. Triangles turn counter-clockwise (see orientation()), begin at their lowest index and are
// sorted. Empty where all points lie on one line. O(n log n) plus the flips: 1024 points take a few milliseconds.
std::vector<Triangle> delaunay(std::span<const IntPoint> points);

}  // namespace lf
