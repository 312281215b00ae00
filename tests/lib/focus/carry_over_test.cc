// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/carry_over.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace lf {
namespace {

// A wall 4 m in front of the plane z = 0, and before it, from x = 0 on, one at 1 m.
View two_walls(const Vec3& eye) {
  View view;
  view.width = 160;
  view.height = 120;
  view.lens = Lens::pinhole(160, 79.5, 59.5);
  view.pose.position = eye;
  FocalMap map = FocalMap::for_view(160, 120);
  map.from = {{0, 0, 1}, 0};
  map.farthest = 0.1;
  map.nearest = 1.2;
  for (int j = 0; j < map.rows; j++)
    for (int i = 0; i < map.columns; i++) {
      const double u = (4 * i + 1.5 - 79.5) / 160, at_one_metre = eye.x + u * (1 - eye.z);
      map.levels.push_back(map.level_of(at_one_metre >= 0 ? 1 : 0.25));
    }
  view.focus.map = std::make_shared<FocalMap>(map);
  return view;
}

double share_of_wrong_nodes(const FocalMap& carried, const FocalMap& truth) {
  EXPECT_EQ(carried.levels.size(), truth.levels.size());
  constexpr int kBorder = 5;  // nodes, of which something may come into sight
  int wrong = 0, all = 0;
  for (int j = kBorder; j < truth.rows - kBorder; j++)
    for (int i = kBorder; i < truth.columns - kBorder; i++, all++)
      wrong += carried.levels[j * truth.columns + i] != truth.levels[j * truth.columns + i];
  return static_cast<double>(wrong) / all;
}

TEST(CarryOver, KeepsTheMapOfTheSameView) {
  const View view = two_walls({0, 0, 0});
  EXPECT_EQ(carry_over(view, view), view.focus.map);
}

TEST(CarryOver, FollowsTheEye) {
  const View from = two_walls({0, 0, 0});
  for (const Vec3& eye : {Vec3(0.1, 0, 0), Vec3(-0.1, 0, 0), Vec3(0, 0.05, 0.2), Vec3(0.03, 0.02, -0.3)}) {
    const View to = two_walls(eye);
    const std::shared_ptr<const FocalMap> carried = carry_over(from, to);
    // A column of nodes along the edge may be one off.
    EXPECT_LE(share_of_wrong_nodes(*carried, *to.focus.map), 1.01 / 30) << eye.x << ", " << eye.z;
    if (std::abs(eye.x) > 0.05) {
      EXPECT_GT(share_of_wrong_nodes(*from.focus.map, *to.focus.map), 1.01 / 30) << "something had to move";
    }
  }
}

TEST(CarryOver, TurnsWithTheView) {
  const View from = two_walls({0, 0, 0});
  View to = from;
  to.pose.orientation = glm::angleAxis(4 / 160., Vec3(0, 1, 0));  // a node to the right
  const std::shared_ptr<const FocalMap> carried = carry_over(from, to);
  const auto edge = [](const FocalMap& map) {
    const auto row = map.levels.begin() + 10 * map.columns;
    return std::adjacent_find(row, row + map.columns, std::not_equal_to<>()) - row;
  };
  EXPECT_EQ(edge(*carried), edge(*from.focus.map) - 1);
}

TEST(CarryOver, OutOfSightIsNotTheEnd) {
  const View from = two_walls({0, 0, 0});
  View to = from;
  to.pose.orientation = glm::angleAxis(M_PI, Vec3(0, 1, 0));  // looks back
  EXPECT_EQ(carry_over(from, to)->levels, std::vector<uint8_t>(40 * 30, 0));
  to = from;
  to.width = 40;
  to.height = 30;
  to.lens = Lens::pinhole(40, 19.5, 14.5);
  EXPECT_EQ(carry_over(from, to)->levels.size(), 10u * 8);
}

}  // namespace
}  // namespace lf
