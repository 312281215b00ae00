// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/rays.h"

#include <algorithm>
#include <limits>

namespace lf {

Rays::Rays(const Lens& lens, int width, int height)
    : width_(width), height_(height), cx_(lens.cx()), cy_(lens.cy()), inv_fx_(1 / lens.fx()), inv_fy_(1 / lens.fy()) {
  if (!lens.has_distortion()) return;
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  table_.reserve(static_cast<size_t>(width) * height);
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++) table_.push_back(lens.unproject(Vec2(x, y)).value_or(Vec2(kNone, kNone)));
}

Vec2 Rays::at_centre_of_four(int x, int y) const {
  const int x1 = std::min(x + 1, width_ - 1), y1 = std::min(y + 1, height_ - 1);
  if (separable()) return {((x + x1) / 2.0 - cx_) * inv_fx_, ((y + y1) / 2.0 - cy_) * inv_fy_};
  return (at(x, y) + at(x1, y) + at(x, y1) + at(x1, y1)) / 4.0;
}

}  // namespace lf
