// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/depth_range.h"

#include <array>

namespace lf {
namespace {

constexpr int kMostLevel = static_cast<int>(FocalMap::kLevels);

}  // namespace

void set_range(const DepthRange& range, FocalMap& map) {
  std::array<uint8_t, kMostLevel + 1> level{};
  const FocalMap before = {.from = map.from, .farthest = map.farthest, .nearest = map.nearest, .levels = {}};
  map.farthest = range.farthest;
  map.nearest = range.nearest;
  for (int i = 0; i <= kMostLevel; i++) level[i] = map.level_of(before.inverse_of(i));
  for (uint8_t& at : map.levels) at = level[at];
}

}  // namespace lf
