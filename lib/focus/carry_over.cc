// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/carry_over.h"

#include <algorithm>
#include <cmath>

#include "focus/carried_nodes.h"

namespace lf {
namespace {

constexpr int kHole = -1;

// Fills holes along a row from both sides. False if there is nothing to fill from.
bool fill_row(int* row, int columns) {
  const int* const end = row + columns;
  if (std::all_of(row, const_cast<int*>(end), [](int v) { return v == kHole; })) return false;
  for (int i = 0; i < columns;) {
    if (row[i] != kHole) {
      i++;
      continue;
    }
    int past = i;
    while (past < columns && row[past] == kHole) past++;
    const int before = i > 0 ? row[i - 1] : kHole, after = past < columns ? row[past] : kHole;
    const int level = before == kHole ? after : after == kHole ? before : std::min(before, after);
    std::fill(row + i, row + past, level);
    i = past;
  }
  return true;
}

}  // namespace

std::shared_ptr<const FocalMap> carry_over(const View& from, const View& to) {
  const std::shared_ptr<const FocalMap>& map = from.focus.map;
  if (from.pose == to.pose && from.lens == to.lens && from.width == to.width && from.height == to.height) return map;
  auto carried = std::make_shared<FocalMap>(*map);
  carried->columns = FocalMap::nodes(to.width, map->step);
  carried->rows = FocalMap::nodes(to.height, map->step);
  const size_t nodes = static_cast<size_t>(carried->columns) * static_cast<size_t>(carried->rows);
  std::vector<int> levels(nodes, kHole);

  CarriedNodes nodes_of(from, to, carried->columns, carried->rows);
  for (int j = 0; j < map->rows; j++) {
    const CarriedNodes::Row row = nodes_of.row(j);
    const uint8_t* const row_levels = &map->levels[static_cast<size_t>(j) * map->columns];
    for (int i = 0; i < map->columns; i++)
      for (int y = row.top[i]; y < row.bottom[i]; y++)
        for (int x = row.left[i]; x < row.right[i]; x++) {
          int& there = levels[static_cast<size_t>(y) * carried->columns + x];
          there = std::max<int>(there, row_levels[i]);
        }
  }

  std::vector<int> filled(carried->rows);
  for (int j = 0; j < carried->rows; j++)
    filled[j] = fill_row(levels.data() + static_cast<size_t>(j) * carried->columns, carried->columns);
  for (int j = 0; j < carried->rows; j++) {
    if (filled[j]) continue;
    // The nearest row that has something; without any, everything is far.
    int nearest = kHole;
    for (int k = 0; k < carried->rows; k++)
      if (filled[k] && (nearest == kHole || std::abs(k - j) < std::abs(nearest - j))) nearest = k;
    const auto row = [&](int k) { return levels.begin() + static_cast<ptrdiff_t>(k) * carried->columns; };
    if (nearest == kHole)
      std::fill(row(j), row(j + 1), 0);
    else
      std::copy(row(nearest), row(nearest + 1), row(j));
  }
  carried->levels.assign(nodes, 0);
  std::transform(levels.begin(), levels.end(), carried->levels.begin(),
                 [](int level) { return static_cast<uint8_t>(level); });
  return carried;
}

}  // namespace lf
