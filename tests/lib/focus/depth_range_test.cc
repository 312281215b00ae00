// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/depth_selection.h"

#include "support/test.h"

namespace lf {
namespace {

FocalMap map_at(uint8_t level) {
  FocalMap map;
  map.from = {{0, 0, 1}, 0};
  map.columns = 50;
  map.rows = 20;
  map.farthest = 0.25;
  map.nearest = 1;
  map.levels.assign(1000, level);
  return map;
}

TEST(DepthRange, ChangingTheRangeKeepsSurfaces) {
  FocalMap map = map_at(0);
  for (int i = 0; i < 1000; i++) map.levels[i] = static_cast<uint8_t>(i % 256);
  const FocalMap before = map;
  set_range({0.1, 1.4}, map);
  const double half_a_level = 1.3 / 255 / 2;
  for (int i = 0; i < 1000; i++)
    ASSERT_NEAR(map.inverse_of(map.levels[i]), before.inverse_of(before.levels[i]), half_a_level + 1e-12);
}

}  // namespace
}  // namespace lf
