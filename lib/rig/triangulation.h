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

// A point in quantised plane coordinates. All functions here are exact for coordinates within +-kMaxCoordinate:
// orientations need 52 bits, the in-circle determinant 105.
struct IntPoint {
  int32_t x = 0, y = 0;
  auto operator<=>(const IntPoint&) const = default;  // lexicographic
};
inline constexpr int32_t kMaxCoordinate = 1 << 24;

// Returns twice the signed area of a, b, c: positive if they turn from +x towards +y ("counter-clockwise").
inline int64_t orientation(IntPoint a, IntPoint b, IntPoint c) {
  const int64_t bx = int64_t{b.x} - a.x, by = int64_t{b.y} - a.y;
  const int64_t cx = int64_t{c.x} - a.x, cy = int64_t{c.y} - a.y;
  return bx * cy - by * cx;
}

// Returns 1 if d lies inside the circle through the counter-clockwise a, b, c, 0 on the circle, -1 outside. Lifted 3x3
// determinant (Guibas and Stolfi 1985), relative to d.
inline int in_circle(IntPoint a, IntPoint b, IntPoint c, IntPoint d) {
  const int64_t ax = int64_t{a.x} - d.x, ay = int64_t{a.y} - d.y;
  const int64_t bx = int64_t{b.x} - d.x, by = int64_t{b.y} - d.y;
  const int64_t cx = int64_t{c.x} - d.x, cy = int64_t{c.y} - d.y;
  const __int128 det = static_cast<__int128>(ax * ax + ay * ay) * (bx * cy - by * cx) +
                       static_cast<__int128>(bx * bx + by * by) * (cx * ay - cy * ax) +
                       static_cast<__int128>(cx * cx + cy * cy) * (ax * by - ay * bx);
  return (det > 0) - (det < 0);
}

// True if p lies in the counter-clockwise triangle a, b, c or on its border.
inline bool triangle_contains(IntPoint a, IntPoint b, IntPoint c, IntPoint p) {
  return orientation(a, b, p) >= 0 && orientation(b, c, p) >= 0 && orientation(c, a, p) >= 0;
}

// True if segments a b and c d cross at a point inside both segments.
inline bool segments_cross(IntPoint a, IntPoint b, IntPoint c, IntPoint d) {
  const int64_t c_side = orientation(a, b, c), d_side = orientation(a, b, d);
  const int64_t a_side = orientation(c, d, a), b_side = orientation(c, d, b);
  return ((c_side > 0 && d_side < 0) || (c_side < 0 && d_side > 0)) &&
         ((a_side > 0 && b_side < 0) || (a_side < 0 && b_side > 0));
}

// All hosts must compute the same mesh, so camera positions are converted to integers, and the triangulation decides
// only by integers. The conversion gives the same integers on every machine with IEEE doubles: it uses only +, -, *, /
// and sqrt in a fixed order, and scale factors that are powers of two.

// Centres relative to their mean, scaled by a power of two so that every component is within +-1.
struct CameraCentres {
  std::vector<Vec3> at;
  // Step of the integer coordinates in the units of `at`, a power of two. It is usually 2^-23. The step is larger if
  // the array is very far from the origin of the world, because the positions then have large rounding errors. It is a
  // few times these errors, so that the errors do not affect the mesh.
  double quantum = 0x1p-23;
};
// Quantises camera positions, which are in metres. Throws Error ("cameras[i].position: ...") if a position is not
// finite.
CameraCentres normalised_centres(std::span<const Vec3> positions);

struct PlaneAxes {
  Vec3 x{1, 0, 0}, y{0, 1, 0}, normal{0, 0, 1};
};

// Returns the directions of largest (x), middle (y) and smallest (normal) spread about the mean. x is the least-squares
// line; x and y span the least-squares plane. Eigenvectors of the scatter matrix by cyclic Jacobi rotations (Golub and
// Van Loan, Matrix Computations, 8.5).
PlaneAxes principal_axes(std::span<const Vec3> points);

// Returns axes in the best-fit plane of `points`, with the normal along `forward`. x follows `right`, so that rows and
// columns of upright cameras stay rows and columns of integers at any tilt in the world. `right` is the sum of unit
// vectors, one for each point. If its component in the plane is below a tenth of their number, x is the direction of
// largest spread.
PlaneAxes best_fit_plane(std::span<const Vec3> points, const Vec3& right, const Vec3& forward);

// Returns axes in the plane with this normal (any length > 0); x is as close as possible to an axis of `reference`.
PlaneAxes plane_with_normal(const Vec3& normal, const PlaneAxes& reference);

// Rounds a normalised centre to multiples of `quantum`; the result is within +-kMaxCoordinate.
IntPoint quantise(const Vec3& centre, const PlaneAxes& axes, double quantum);

// True if three points are collinear to within `tolerance` (height over the longest side).
bool are_collinear(const Vec3& a, const Vec3& b, const Vec3& c, double tolerance);

using Triangle = std::array<CameraIndex, 3>;

// Returns `t` rotated to start at its lowest index, with the same orientation.
inline Triangle canonical_triangle(const Triangle& t) {
  if (t[1] < t[0] && t[1] <= t[2]) return {t[1], t[2], t[0]};
  if (t[2] < t[0] && t[2] < t[1]) return {t[2], t[0], t[1]};
  return t;
}

// Returns the Delaunay triangulation of `points` (within +-kMaxCoordinate) as indices into `points`. Unique: cocircular
// points become a fan from the lowest index, and only the lowest index of coincident points is used. Triangles are
// counter-clockwise (see orientation()), start at their lowest index and are sorted. Empty if all points are collinear.
// O(n log n) plus the flips: 1024 points take a few milliseconds.
std::vector<Triangle> delaunay(std::span<const IntPoint> points);

// A connected part of a camera's link. The link consists of the edges opposite the camera in its triangles, so it
// surrounds the hole that removing the camera would leave. The cameras are in the order along these edges.
struct LinkPart {
  std::vector<CameraIndex> camera;
  bool closed = false;  // true: a ring around an inner camera; false: a chain, as at the border of the mesh
};

// Returns the link of `camera`. `star`: the triangles around the camera. Each part has at least three cameras and
// follows the orientation of its first triangle in `star`. There is usually one part, but several if parts of the mesh
// touch only at the camera. Ignores triangles with repeated corners. Empty if three link edges share a camera (not a
// surface).
std::vector<LinkPart> camera_link(std::span<const Triangle> star, CameraIndex camera);

// The border of a hole in plane coordinates (within +-kMaxCoordinate), with the hole on its left (see orientation()).
// Closed: a polygon. Open: a chain of the mesh border; the hole is the bay on the left of the chain.
struct Outline {
  std::vector<CameraIndex> camera;
  std::vector<IntPoint> at;
  bool closed = false;
};

// A directed edge of the mesh around the hole, in the orientation of its triangle.
struct MeshEdge {
  CameraIndex from, to;
  IntPoint from_at, to_at;
};

// Fills a hole in the mesh with triangles, by clipping ears one after another. An ear is a triangle of three neighbours
// on the outline (previous, tip, next) that lies in the hole. It must have an area and must not contain another vertex
// of the outline or of `around`, except at a corner. Its new edge must not cross an edge of `around`, and must not
// exist yet in the same direction. The next ear is the ear with the fewest outline vertices inside its circumcircle
// (none for a Delaunay triangle), and among equals the ear with the lowest tip index. The function stops when the hole
// is filled or no ear is left; the rest of an outline that crosses itself stays open. Returns the triangles in clipping
// order, with the outline's orientation, starting at their lowest index. Cost: O(n^2 + n |around|).
std::vector<Triangle> clip_ears(const Outline& outline, std::span<const MeshEdge> around);

// Removes `camera` from the mesh and fills the hole. Its triangles are erased, all other triangles keep their order,
// and the new triangles are appended in the order of clip_ears(), with the same orientation. The hole is projected onto
// the mean plane of the erased triangles, or, if they have no area, onto `plane`, the best-fit plane of `centres`. At
// the border of the mesh, only bays between neighbours of the camera are filled, without overlaps with other faces. The
// hole stays open if the mesh around the camera is not a surface.
void remove_camera(std::vector<Triangle>& faces, CameraIndex camera, const CameraCentres& centres,
                   const PlaneAxes& plane);

}  // namespace lf
