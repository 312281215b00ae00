// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>
#include <vector>

#include "rig/delaunay.h"
#include "rig/plane_coordinates.h"

namespace lf {

// Takes `camera` out of the mesh `faces`: the triangles around it go, the rest keep their order, and the triangles that
// fill the hole are appended in order of clipping (see clip_ears()). They turn as the ones they replace.
// The hole is filled in its local plane, normal to the sum of the area vectors of the triangles it had (parallel to
// `plane` where that sum vanishes), quantised with the array's quantum. Where the camera was at the border of the mesh
// its neighbours' chain is filled where it has bays, clear of what else of the mesh lies there. Where the mesh around
// the camera is not a surface the hole stays.
// `plane`: the best-fit plane of `centres`.
void remove_camera(std::vector<Triangle>& faces, CameraIndex camera, const CameraCentres& centres,
                   const PlaneAxes& plane);

// The border of a hole in plane coordinates (within +-kMaxCoordinate), walked with the hole on its left (see
// orientation()). Closed: a polygon. Open: a chain of the mesh's border, the hole is the bay on its left.
struct Outline {
  std::vector<CameraIndex> camera;
  std::vector<IntPoint> at;  // place of each camera
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

// A part of the link of a camera (the edges opposite it in the triangles around it): cameras in walking order.
struct LinkPart {
  std::vector<CameraIndex> camera;
  bool closed = false;  // a ring around an inner camera; else a chain, as at the border of the mesh
};

// The link of `camera`; `star`: the triangles that have it as a corner. Each part is walked the way its first
// triangle in `star` turns, and has at least three cameras. Usually one part; several where parts of the mesh meet in
// the camera alone. Triangles with repeated corners are ignored. Empty where three edges of the link meet in a camera
// (not a surface).
std::vector<LinkPart> camera_link(std::span<const Triangle> star, CameraIndex camera);

}  // namespace lf
