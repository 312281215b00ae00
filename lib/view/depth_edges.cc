// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/depth_edges.h"

#include <algorithm>

namespace lf {

namespace {

// Returns the levels of the four corners of a cell. Nodes repeat beyond the border.
std::array<double, 4> corners_of(const FocalMap& map, int i, int j) {
  const auto level = [&](int column, int row) {
    column = std::clamp(column, 0, map.columns - 1);
    row = std::clamp(row, 0, map.rows - 1);
    return static_cast<double>(map.levels[static_cast<size_t>(row) * map.columns + column]);
  };
  return {level(i - 1, j - 1), level(i, j - 1), level(i - 1, j), level(i, j)};
}

}  // namespace

DepthEdges::DepthEdges(const FocalMap& map, double apart) : columns(map.columns + 1), rows(map.rows + 1) {
  // A request cannot cause more memory: 64 bytes for each cell, and 16 bytes for each cell and camera.
  constexpr int32_t kMaxCells = 1 << 17;
  int32_t count = 0;
  do {
    index.assign(static_cast<size_t>(columns) * rows, -1);
    count = 0;
    const double levels_apart = apart / (map.nearest - map.farthest) * FocalMap::kLevels;
    for (int j = 0; j < rows; j++)
      for (int i = 0; i < columns; i++) {
        const auto [least, largest] = std::ranges::minmax(corners_of(map, i, j));
        if (largest - least > levels_apart) index[static_cast<size_t>(j) * columns + i] = count++;
      }
    apart = std::max(2 * apart, (map.nearest - map.farthest) / FocalMap::kLevels);
  } while (count > kMaxCells);
  cells.resize(static_cast<size_t>(count));
}

DepthEdges::Sides::Sides(const FocalMap& map, int i, int j) : map_(map), levels_(corners_of(map, i, j)) {
  const auto [least, largest] = std::ranges::minmax(levels_);
  middle_ = (least + largest) / 2;
}

std::pair<double, double> DepthEdges::Sides::inverse_at(int k) const {
  const double u = (k % kSize + 0.5) / kSize, v = (k / kSize + 0.5) / kSize;
  const std::array weights{(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v};
  std::array<double, 2> sum{}, weight{};
  for (size_t corner = 0; corner < weights.size(); corner++) {
    const size_t side = levels_[corner] > middle_ ? 0 : 1;
    sum[side] += weights[corner] * levels_[corner];
    weight[side] += weights[corner];
  }
  return {map_.inverse_of(sum[0] / weight[0]), map_.inverse_of(sum[1] / weight[1])};
}

}  // namespace lf
