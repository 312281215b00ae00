// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

// From parameters to pixels: for the solver, which differentiates it, and for residuals.

namespace lf::projection {

// v = conjugate(q) * x * q: from the world's axes to the camera's.
inline void rotate_to_camera(const double* q, const double* x, double* v) {
  const double w = q[0], a = -q[1], b = -q[2], c = -q[3];
  const double tx = 2 * (b * x[2] - c * x[1]), ty = 2 * (c * x[0] - a * x[2]), tz = 2 * (a * x[1] - b * x[0]);
  v[0] = x[0] + w * tx + b * tz - c * ty;
  v[1] = x[1] + w * ty + c * tx - a * tz;
  v[2] = x[2] + w * tz + a * ty - b * tx;
}

// A point in the camera's axes to a pixel, by the lens terms of a CameraState's block; false behind the camera. The
// lens is that of geometry/lens.h.
template <class T>
bool project_in_camera(const T* x, const T* lens, double aspect, double p1, double p2, T* pixel) {
  if (!(x[2] > T(1e-9))) return false;
  const T u = x[0] / x[2], v = x[1] / x[2], r2 = u * u + v * v;
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

// A point of the world to a pixel of a CameraState's block; false behind the camera.
inline bool project(const double* camera, double aspect, double p1, double p2, const double* point, double* pixel) {
  const double from_centre[3] = {point[0] - camera[4], point[1] - camera[5], point[2] - camera[6]};
  double x[3];
  rotate_to_camera(camera, from_centre, x);
  return project_in_camera(x, camera + 7, aspect, p1, p2, pixel);
}

// The end of a bar of unit length: light 0 at -1/2, light 1 at +1/2.
inline double bar_side(unsigned light) { return light == 0 ? -0.5 : 0.5; }
inline void bar_end(const double* bar, unsigned light, double* point) {
  for (int i = 0; i < 3; i++) point[i] = bar[i] + bar_side(light) * bar[3 + i];
}

}  // namespace lf::projection
