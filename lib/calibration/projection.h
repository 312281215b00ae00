// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

// Templates for automatic differentiation: included where Ceres is.

namespace lf::projection {

// v = conjugate(q) * x * q: from the world's axes to the camera's.
template <class T>
void rotate_to_camera(const T* q, const T* x, T* v) {
  const T w = q[0], a = -q[1], b = -q[2], c = -q[3];
  const T tx = T(2) * (b * x[2] - c * x[1]), ty = T(2) * (c * x[0] - a * x[2]), tz = T(2) * (a * x[1] - b * x[0]);
  v[0] = x[0] + w * tx + b * tz - c * ty;
  v[1] = x[1] + w * ty + c * tx - a * tz;
  v[2] = x[2] + w * tz + a * ty - b * tx;
}

// A point of the world to a pixel of a CameraState's block; false behind the camera. The lens is that of
// geometry/lens.h.
template <class T>
bool project(const T* camera, double aspect, double p1, double p2, const T* point, T* pixel) {
  const T from_centre[3] = {point[0] - camera[4], point[1] - camera[5], point[2] - camera[6]};
  T x[3];
  rotate_to_camera(camera, from_centre, x);
  if (!(x[2] > T(1e-9))) return false;
  const T u = x[0] / x[2], v = x[1] / x[2], r2 = u * u + v * v;
  const T* lens = camera + 7;
  const T radial = T(1) + r2 * (lens[3] + r2 * lens[4]);
  T du = u * radial, dv = v * radial;
  if (p1 != 0 || p2 != 0) {
    du += T(2 * p1) * u * v + T(p2) * (r2 + T(2) * u * u);
    dv += T(p1) * (r2 + T(2) * v * v) + T(2 * p2) * u * v;
  }
  pixel[0] = lens[0] * du + lens[1];
  pixel[1] = lens[0] * T(aspect) * dv + lens[2];
  return true;
}

// The end of a bar of unit length: light 0 at -1/2, light 1 at +1/2.
template <class T>
void bar_end(const T* bar, unsigned light, T* point) {
  const double half = light == 0 ? -0.5 : 0.5;
  for (int i = 0; i < 3; i++) point[i] = bar[i] + T(half) * bar[3 + i];
}

}  // namespace lf::projection
