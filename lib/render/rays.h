// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "base/rect.h"
#include "base/worker_pool.h"
#include "geometry/lens.h"

namespace lf {

// Lines of sight (u, v, 1) of a view's pixels: computed for pinhole lenses, looked up for distorted ones.
// A pixel that no ray falls on has NaN for u and v.
class Rays {
 public:
  // `parallel`: computes the table of a distorted lens, which takes lens.mean_steps() per pixel.
  Rays(const Lens& lens, int width, int height, const ParallelFor& parallel = serial_for);

  bool separable() const { return !table_; }  // u depends on x alone and v on y alone
  Vec2 at(int x, int y) const {
    if (separable()) return {(x - cx_) * inv_fx_, (y - cy_) * inv_fy_};
    return table_[static_cast<size_t>(y) * width_ + x];
  }
  // The line of sight between pixel centres, at (x + 0.5, y + 0.5), for chroma: exact for pinholes, the mean of the
  // four pixels otherwise (the pixels to the right and below are clamped to the view).
  Vec2 at_centre_of_four(int x, int y) const;

 private:
  int width_, height_;
  double cx_, cy_, inv_fx_, inv_fy_;
  std::shared_ptr<const Vec2[]> table_;  // row by row; null for a pinhole
};

// Bounds the pixels of a view whose line of sight d = (u, v, 1) has h . d >= 0 for each of several half-planes h.
class RegionBounds {
 public:
  // `rays`, `lens`: of the view; `rays` must outlive this. `parallel`: visits the pixels of a distorted view.
  RegionBounds(const Rays& rays, const Lens& lens, int width, int height, const ParallelFor& parallel = serial_for);

  // The bounds: tight for pinholes (the view's rectangle clipped by the half-planes), whole tiles for distorted lenses.
  // Never misses a pixel, rounding included.
  Rect bound(std::span<const Vec3> half_planes) const;

 private:
  struct Tile {
    Rect rect;
    Vec2 low, high;  // bounds of the tile's rays; low > high: there are none
    bool may_hold(std::span<const Vec3> half_planes) const;
    void add(const Tile& other);
  };
  // A square of tiles: one test tells that none of them holds anything.
  struct Block {
    Tile whole;
    size_t first, past;  // of tiles_
    bool may_hold(std::span<const Vec3> half_planes) const;
  };
  Rect bound_polygon(std::span<const Vec3> half_planes) const;
  Rect bound_tiles(std::span<const Vec3> half_planes) const;

  int width_, height_;
  double fx_, fy_, cx_, cy_;
  std::vector<Tile> tiles_;  // distorted lenses only; block by block
  std::vector<Block> blocks_;
};

}  // namespace lf
