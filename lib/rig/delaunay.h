// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <span>
#include <vector>

#include "rig/plane_coordinates.h"
#include "rig/rig.h"

namespace lf {

// Three cameras by index; the order says which way the triangle turns.
using Triangle = std::array<CameraIndex, 3>;

// `t`, named from its lowest index on and turning the same way.
inline Triangle lowest_first(const Triangle& t) {
  if (t[1] < t[0] && t[1] <= t[2]) return {t[1], t[2], t[0]};
  if (t[2] < t[0] && t[2] < t[1]) return {t[2], t[0], t[1]};
  return t;
}

// The Delaunay triangulation of `points` (within +-kMaxCoordinate), triangles named by places in `points`.
// Unique: a polygon of cocircular points is split into the fan from its lowest index, of coincident points only the
// lowest index is used. Triangles turn counter-clockwise (see orientation()), begin at their lowest index and are
// sorted. Empty where all points lie on one line. O(n log n) plus the flips: 1024 points take a few milliseconds.
std::vector<Triangle> delaunay(std::span<const IntPoint> points);

}  // namespace lf
