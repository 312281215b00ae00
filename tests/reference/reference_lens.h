// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>

#include "geometry/lens.h"
#include "reference/small_vec.h"

namespace lf::reference {

struct P2 {
  Real x = 0, y = 0;
};

// The lens models of docs/design.md, from a Lens's model and parameters alone. Everything that has to be solved is
// solved by bisection or by Newton's method on differences: slow, and nothing to get wrong.
class ReferenceLens {
 public:
  explicit ReferenceLens(const lf::Lens& lens);

  // Camera coordinates to a pixel position; nothing for Z <= 0 or beyond the fold.
  std::optional<P2> project(const V3& x_camera) const;
  // A pixel's line of sight (u, v, 1); nothing where no ray falls.
  std::optional<P2> line_of_sight(const P2& pixel) const;
  // The first undistorted radius at which r (1 + k1 r^2 + k2 r^4) stops growing; infinity if it never does.
  Real fold_radius() const { return fold_; }

 private:
  P2 distort(const P2& undistorted) const;

  Real fx_, fy_, cx_, cy_;
  Real k1_ = 0, k2_ = 0, p1_ = 0, p2_ = 0;
  Real fold_;
};

}  // namespace lf::reference
