// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>
#include <vector>

#include "base/rect.h"
#include "render/rays.h"

namespace lf {

// Bounds the pixels of a view whose line of sight d = (u, v, 1) has h . d >= 0 for each of several half-planes h.
class RegionBounds {
 public:
  // `rays`, `lens`: of the view; `rays` must outlive this.
  RegionBounds(const Rays& rays, const Lens& lens, int width, int height);

  // Pinholes: tight (the view's rectangle clipped by the half-planes). Distorted lenses: conservative, to whole tiles.
  // Never misses a pixel, rounding included.
  Rect bound(std::span<const Vec3> half_planes) const;

 private:
  struct Tile {
    Rect rect;
    Vec2 low, high;  // of its rays; low > high: no ray
  };
  Rect bound_polygon(std::span<const Vec3> half_planes) const;
  Rect bound_tiles(std::span<const Vec3> half_planes) const;

  int width_, height_;
  double fx_, fy_, cx_, cy_;
  std::vector<Tile> tiles_;  // distorted lenses only
};

}  // namespace lf
