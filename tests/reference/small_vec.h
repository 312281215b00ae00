// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cmath>

namespace lf::reference {

// The widest real the machine has (80-bit on x86): errors of the reference itself then never matter.
using Real = long double;

struct V3 {
  Real x = 0, y = 0, z = 0;
};

inline V3 operator+(const V3& a, const V3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline V3 operator-(const V3& a, const V3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline V3 operator*(Real s, const V3& a) { return {s * a.x, s * a.y, s * a.z}; }
inline Real dot(const V3& a, const V3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Real norm(const V3& a) { return std::sqrt(dot(a, a)); }
inline V3 cross(const V3& a, const V3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// Anything with x, y, z (and w) members.
template <typename Vector>
V3 to_v3(const Vector& v) {
  return {v.x, v.y, v.z};
}

// Rodrigues' form of q v q*, with q brought to unit norm; `inverse` rotates by q* instead.
template <typename Quaternion>
V3 rotate(const Quaternion& q, const V3& v, bool inverse = false) {
  const Real sign = inverse ? -1 : 1;
  const Real w = q.w;
  const V3 axis{sign * q.x, sign * q.y, sign * q.z};
  const V3 twice = (2 / (w * w + dot(axis, axis))) * cross(axis, v);
  return v + w * twice + cross(axis, twice);
}

}  // namespace lf::reference
