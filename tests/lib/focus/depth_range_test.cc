// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/depth_range.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

// A thousand nodes between 1 and 4 m (levels 255 and 0), all at `level`.
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

TEST(DepthRange, LevelsInUseAreThoseOfNearlyAllNodesAndATenthMore) {
  FocalMap map = map_at(80);
  std::fill_n(map.levels.begin(), 400, uint8_t{180});
  std::fill_n(map.levels.begin(), 10, uint8_t{255});
  std::fill_n(map.levels.begin() + 10, 10, uint8_t{0});
  EXPECT_EQ(levels_in_use(map), (LevelRange{70, 190}));
  EXPECT_EQ(levels_in_use(map_at(2)), (LevelRange{0, 8})) << "a little more where all is at one";
}

TEST(DepthRange, StaysWhereItIsNotMuchOff) {
  FocalMap map = map_at(80);
  std::fill_n(map.levels.begin(), 400, uint8_t{180});
  EXPECT_EQ(range_for(map), (DepthRange{0.25, 1}));
}

TEST(DepthRange, FollowsASceneThatLiesAtItsEnds) {
  for (const uint8_t level : {uint8_t{254}, uint8_t{1}}) {
    const FocalMap map = map_at(level);
    const double at = map.inverse_of(level);
    EXPECT_NEAR(range_for(map).farthest, at / 1.5, 1e-12);
    EXPECT_NEAR(range_for(map).nearest, 1.5 * at, 1e-12);
  }
  FocalMap far = map_at(0);
  far.farthest = 0;
  EXPECT_EQ(range_for(far), (DepthRange{0, 1})) << "nothing is beyond infinity";
}

TEST(DepthRange, NarrowsWhereMostOfItIsOfNoUse) {
  FocalMap map = map_at(40);
  map.nearest = 3;
  const DepthRange range = range_for(map);
  EXPECT_LT(range.nearest, 1.1);
  set_range(range, map);
  EXPECT_EQ(range_for(map), range) << "and then stays";
}

TEST(DepthRange, SurfacesStayWhereTheyAre) {
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
