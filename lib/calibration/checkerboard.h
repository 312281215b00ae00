// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <vector>

#include "base/vec.h"
#include "image/image.h"

namespace lf {

// A flat board of black and white squares. Corners are those between four squares, counted row by row.
struct Checkerboard {
  int columns = 0, rows = 0;  // inner corners: a chess board has 7x7
  double square = 1;          // side of a square; metres, or 1 where only lenses are wanted

  size_t num_corners() const { return static_cast<size_t>(columns) * rows; }
  Vec2 corner(size_t i) const {
    return Vec2(static_cast<double>(i % columns), static_cast<double>(i / columns)) * square;
  }
};

// The corners of the whole board in an RGB image, in pixels, to a fraction of one; nothing where it is not there or
// a part of it is hidden.
std::optional<std::vector<Vec2>> find_checkerboard(const Image& image, const Checkerboard& board);

}  // namespace lf
