// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/depth_range.h"

#include <algorithm>
#include <array>

namespace lf {
namespace {

constexpr int kMostLevel = static_cast<int>(FocalMap::kLevels);
constexpr double kOutliers = 0.03;       // of the nodes, to each side
constexpr double kBeyond = 1.5;          // of the scene's nearest and farthest distance
constexpr int kAtTheEnd = 8;             // levels
constexpr double kMuchOff = 2;           // times the range that it should be

LevelRange without_outliers(const FocalMap& map) {
  std::array<size_t, kMostLevel + 1> nodes{};
  for (const uint8_t level : map.levels) nodes[level]++;
  const auto few = static_cast<size_t>(kOutliers * static_cast<double>(map.levels.size()));
  LevelRange range;
  for (size_t before = nodes[0]; before <= few; before += nodes[++range.first]) {
  }
  for (size_t beyond = nodes[kMostLevel]; beyond <= few; beyond += nodes[--range.last]) {
  }
  return range;
}

}  // namespace

LevelRange levels_in_use(const FocalMap& map) {
  constexpr int kLeastMore = 6;
  const LevelRange range = without_outliers(map);
  const int more = std::max((range.last - range.first) / 10, kLeastMore);
  return {std::max(range.first - more, 0), std::min(range.last + more, kMostLevel)};
}

DepthRange range_for(const FocalMap& map) {
  const LevelRange scene = without_outliers(map);
  const DepthRange right{map.inverse_of(scene.first) / kBeyond, kBeyond * map.inverse_of(scene.last)};
  const bool at_an_end = (scene.first < kAtTheEnd && map.farthest > 0) || scene.last > kMostLevel - kAtTheEnd;
  const bool too_wide = map.nearest - map.farthest > kMuchOff * (right.nearest - right.farthest);
  if ((at_an_end || too_wide) && right.nearest > right.farthest) return right;
  return {map.farthest, map.nearest};
}

void set_range(const DepthRange& range, FocalMap& map) {
  std::array<uint8_t, kMostLevel + 1> level{};
  const FocalMap before = {.from = map.from, .farthest = map.farthest, .nearest = map.nearest, .levels = {}};
  map.farthest = range.farthest;
  map.nearest = range.nearest;
  for (int i = 0; i <= kMostLevel; i++) level[i] = map.level_of(before.inverse_of(i));
  for (uint8_t& at : map.levels) at = level[at];
}

}  // namespace lf
