// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "geometry/lens.h"

namespace lf {

// Lines of sight (u, v, 1) of a view's pixels: computed for pinhole lenses, looked up for distorted ones.
// A pixel that no ray falls on has NaN for u and v.
class Rays {
 public:
  Rays(const Lens& lens, int width, int height);

  bool separable() const { return table_.empty(); }  // u depends on x alone and v on y alone
  Vec2 at(int x, int y) const {
    if (separable()) return {(x - cx_) * inv_fx_, (y - cy_) * inv_fy_};
    return table_[static_cast<size_t>(y) * width_ + x];
  }
  // Between pixel centres, for chroma at (x + 0.5, y + 0.5): exact for pinholes, the mean of the four pixels otherwise
  // (the pixels to the right and below are clamped to the view).
  Vec2 at_centre_of_four(int x, int y) const;

 private:
  int width_, height_;
  double cx_, cy_, inv_fx_, inv_fy_;
  std::vector<Vec2> table_;
};

}  // namespace lf
