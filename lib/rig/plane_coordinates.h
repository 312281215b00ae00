// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <compare>
#include <cstdint>
#include <span>
#include <vector>

#include "base/vec.h"

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

}  // namespace lf
