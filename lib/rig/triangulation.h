// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <span>
#include <vector>

#include "base/maths.h"
#include "rig/rig.h"

namespace lf {

// A point in quantised plane coordinates. Every function here is exact for coordinates within +-kMaxCoordinate:
// orientations need 52 bits, the in-circle determinant 105.
struct IntPoint {
  int32_t x = 0, y = 0;
  auto operator<=>(const IntPoint&) const = default;  // lexicographic
};
inline constexpr int32_t kMaxCoordinate = 1 << 24;

// Twice the signed area of a, b, c: positive where they turn from +x towards +y ("counter-clockwise").
inline int64_t orientation(IntPoint a, IntPoint b, IntPoint c) {
  const int64_t bx = int64_t{b.x} - a.x, by = int64_t{b.y} - a.y;
  const int64_t cx = int64_t{c.x} - a.x, cy = int64_t{c.y} - a.y;
  return bx * cy - by * cx;
}

// 1: d lies inside the circle through the counter-clockwise a, b, c; 0: on it; -1: outside.
// The lifted 3x3 determinant (Guibas and Stolfi 1985), relative to d.
inline int in_circle(IntPoint a, IntPoint b, IntPoint c, IntPoint d) {
  const int64_t ax = int64_t{a.x} - d.x, ay = int64_t{a.y} - d.y;
  const int64_t bx = int64_t{b.x} - d.x, by = int64_t{b.y} - d.y;
  const int64_t cx = int64_t{c.x} - d.x, cy = int64_t{c.y} - d.y;
  const __int128 det = static_cast<__int128>(ax * ax + ay * ay) * (bx * cy - by * cx) +
                       static_cast<__int128>(bx * bx + by * by) * (cx * ay - cy * ax) +
                       static_cast<__int128>(cx * cx + cy * cy) * (ax * by - ay * bx);
  return (det > 0) - (det < 0);
}

// Whether p lies in the counter-clockwise triangle a, b, c or on its border.
inline bool in_closed_triangle(IntPoint a, IntPoint b, IntPoint c, IntPoint p) {
  return orientation(a, b, p) >= 0 && orientation(b, c, p) >= 0 && orientation(c, a, p) >= 0;
}

// Whether the segments a b and c d have a point in common that is inside both.
inline bool cross_properly(IntPoint a, IntPoint b, IntPoint c, IntPoint d) {
  const int64_t c_side = orientation(a, b, c), d_side = orientation(a, b, d);
  const int64_t a_side = orientation(c, d, a), b_side = orientation(c, d, b);
  return ((c_side > 0 && d_side < 0) || (c_side < 0 && d_side > 0)) &&
         ((a_side > 0 && b_side < 0) || (a_side < 0 && b_side > 0));
}

// Integer coordinates for camera centres, the same on every IEEE machine: doubles with +, -, *, / and sqrt in a fixed
// order make the axes, scaling is by powers of two, and what is decided afterwards is decided on integers.

// Centres relative to their mean, in units of a power of two metres, so that every component is within +-1 whatever
// the size and place of the array.
struct CameraCentres {
  std::vector<Vec3> at;
  // Resolution of the integers in the same units, a power of two: 2^-23, or a few times the spacing of doubles at the
  // array's distance from the world's origin where that is coarser (noise must not look like structure).
  double quantum = 0x1p-23;
};
// `positions` in metres. Throws Error ("cameras[i].position: ...") if one is not finite.
CameraCentres normalised_centres(std::span<const Vec3> positions);

// The axes of a plane, orthonormal and right-handed.
struct PlaneAxes {
  Vec3 x{1, 0, 0}, y{0, 1, 0}, normal{0, 0, 1};
};

// Directions of largest, middle and smallest spread about the mean: x and y span the plane that fits best in the sense
// of least squares, x is the direction of the line that does. Eigenvectors of the scatter matrix by cyclic Jacobi
// rotations (Golub and Van Loan, Matrix Computations, 8.5).
PlaneAxes principal_axes(std::span<const Vec3> points);

// Axes in the best-fit plane of `points`. The normal goes along `forward`; x follows `right`, so that the rows and
// columns of an array whose cameras stand upright in it stay rows and columns of integers, at any tilt in the world.
// Where `right` is nearly perpendicular to the plane (below a tenth of `count`, the length it would have as the sum of
// that many equal unit vectors) x is the direction of largest spread.
PlaneAxes best_fit_plane(std::span<const Vec3> points, const Vec3& right, const Vec3& forward);

// Axes in the plane with this normal (any length > 0); x as near to one of `reference`'s as can be.
PlaneAxes plane_with_normal(const Vec3& normal, const PlaneAxes& reference);

// Coordinates of a normalised centre, rounded to multiples of `quantum`; within +-kMaxCoordinate.
IntPoint quantise(const Vec3& centre, const PlaneAxes& axes, double quantum);

// Whether three points lie on one line, to within `tolerance` (the height over the longest side).
bool on_one_line(const Vec3& a, const Vec3& b, const Vec3& c, double tolerance);

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

// Takes `camera` out of the mesh `faces`: the triangles around it go, the rest keep their order, and the triangles that
// fill the hole are appended in order of clipping (see clip_ears()). They turn as the ones they replace.
// The hole is filled in its local plane, normal to the sum of the area vectors of the triangles it had (parallel to
// `plane` where that sum vanishes), quantised with the array's quantum. Where the camera was at the border of the mesh
// its neighbours' chain is filled where it has bays, clear of what else of the mesh lies there. Where the mesh around
// the camera is not a surface the hole stays.
// `plane`: the best-fit plane of `centres`.
void remove_camera(std::vector<Triangle>& faces, CameraIndex camera, const CameraCentres& centres,
                   const PlaneAxes& plane);

}  // namespace lf
