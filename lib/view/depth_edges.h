// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "geometry/pose.h"

namespace lf {

// The depths of single pixels at the depth edges of a view, finer than its focal map. The map has a node for every
// kMinStep x kMinStep pixels, and depths are interpolated in the cells between four nodes. In a cell with a silhouette,
// the nodes are on different surfaces, and interpolated depths would be on neither of them.
struct DepthEdges {
  static constexpr int kSize = FocalMap::kMinStep;  // side of a cell, pixels
  static constexpr int kPixels = kSize * kSize;
  using Cell = std::array<float, kPixels>;  // inverse distances of the pixels, row by row, as in the focal map

  DepthEdges() = default;
  // Finds the cells whose corners differ by more than `apart` in inverse distance, in 1/m, or by more if there are too
  // many. The depths of their pixels are 0. The nodes of the map must be kMinStep pixels apart.
  DepthEdges(const FocalMap& map, double apart);

  // Cell (i, j) lies between the columns i - 1 and i and the rows j - 1 and j of the nodes. The outer cells lie between
  // nodes and the border of the view.
  int columns = 0, rows = 0;   // numbers of cells: one more than nodes
  std::vector<int32_t> index;  // the place of each cell in `cells`, row by row; -1 for a cell without an edge
  std::vector<Cell> cells;

  int32_t index_of(int i, int j) const { return index[static_cast<size_t>(j) * columns + i]; }
  // Returns the column or row of the cell that contains a column or row of pixels, and the place of the pixel there.
  static int cell_of(int pixel) { return (pixel + kSize / 2) / kSize; }
  static int in_cell(int pixel) { return (pixel + kSize / 2) % kSize; }
  // Returns the column and row of pixel k of cell (i, j).
  static std::pair<int, int> pixel_of(int i, int j, int k) {
    return {kSize * i - kSize / 2 + k % kSize, kSize * j - kSize / 2 + k / kSize};
  }
  // Returns the depth of a pixel of the view, or null if its cell has no edge.
  const float* depth_at(int x, int y) const {
    const int32_t cell = index_of(cell_of(x), cell_of(y));
    return cell < 0 ? nullptr : &cells[static_cast<size_t>(cell)][in_cell(y) * kSize + in_cell(x)];
  }

  // The two surfaces in a cell with an edge. A corner belongs to the near surface if its level is in the upper half of
  // the range of the four corners.
  class Sides {
   public:
    Sides(const FocalMap& map, int i, int j);
    // Returns the inverse distances of the near and the far surface at pixel k, interpolated between the corners of the
    // surface.
    std::pair<double, double> inverse_at(int k) const;

   private:
    const FocalMap& map_;
    std::array<double, 4> levels_;  // upper left, upper right, lower left, lower right
    double middle_;
  };
};

}  // namespace lf
