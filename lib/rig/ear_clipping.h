// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>
#include <vector>

#include "rig/predicates.h"
#include "rig/triangle.h"

namespace lf {

// The border of a hole in plane coordinates (within +-kMaxCoordinate), walked with the hole on its left (see
// orientation()). Closed: a polygon. Open: a chain of the mesh's border, the hole is the bay on its left.
struct Outline {
  std::vector<CameraIndex> camera;
  std::vector<IntPoint> at;  // of each camera
  bool closed = false;
};

// A directed edge of the mesh around the hole, as its triangle turns.
struct MeshEdge {
  CameraIndex from, to;
  IntPoint from_at, to_at;
};

// Fills the hole by clipping ears: a triangle (previous, tip, next) of neighbours on the outline, with area, on its
// left, that contains no other vertex of the outline or of `around` (one at the very place of a corner does not
// count), whose new edge crosses none of `around` and is not there yet in the same direction. Clipping the tip leaves
// a smaller outline. Of the ears the one with the fewest vertices of the outline inside its circumcircle is taken (a
// Delaunay triangle has none), of equals the one whose tip has the lowest index.
// Ends when the polygon is used up, or no ear is left: a chain without bays, or an outline that crosses itself, whose
// rest stays open. Triangles turn as the outline does, begin at their lowest index and are in order of clipping.
// Cost: O(n^2 + n |around|).
std::vector<Triangle> clip_ears(const Outline& outline, std::span<const MeshEdge> around);

}  // namespace lf
