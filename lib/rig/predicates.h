// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <compare>
#include <cstdint>

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

}  // namespace lf
