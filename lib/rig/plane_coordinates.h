// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>
#include <vector>

#include "base/vec.h"
#include "rig/predicates.h"

namespace lf {

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

// Orthonormal, right-handed.
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
