// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/warp_depth_map.h"

#include "reference/generators.h"
#include "support/every_target.h"
#include "support/rigs.h"
#include "support/test.h"

namespace lf {
namespace {

struct Covered {
  int left, right, top, bottom;
  bool operator==(const Covered&) const = default;
};

// Returns the range of the `count` cells with centres within `size` around `middle`, including the cell that contains
// `middle`.
std::pair<int, int> covered(double middle, double size, int count) {
  const auto inside = [count](double at) { return std::clamp(at, 0., static_cast<double>(count)); };
  const double end = std::max(middle + size / 2 - 0.5, middle);
  return {static_cast<int>(std::min(std::ceil(inside(middle - size / 2 - 0.5)), std::floor(inside(middle)))),
          static_cast<int>(std::floor(inside(end + 1)))};
}

// The rule, one node at a time.
Covered plain(const View& from, const View& to, int columns, int rows, int i, int j) {
  const FocalMap& map = *from.focus.map;
  const double step = map.step, middle = (step - 1) / 2;
  const std::optional<Vec2> ray = from.lens.unproject({step * i + middle, step * j + middle});
  if (!ray) return {};
  const double inverse = map.inverse_of(map.levels[static_cast<size_t>(j) * map.columns + i]);
  const Vec3 d(*ray, 1);
  const Mat3 to_from_view = glm::transpose(to.pose.rotation()) * from.pose.rotation();
  const Vec3 offset = glm::transpose(to.pose.rotation()) * (from.pose.position - to.pose.position);
  const Vec3 normal = glm::transpose(from.pose.rotation()) * map.from.normal;
  const double before = 1 - inverse * map.from.signed_distance(from.pose.position);
  const Vec3 x = before * (to_from_view * d) + inverse * glm::dot(normal, d) * offset;
  const std::optional<Vec2> pixel = to.lens.project(x);
  if (!pixel) return {};
  const double larger = to.lens.fx() / from.lens.fx() * before / x.z, per_step = 1 / step;
  const auto [left, right] = covered((pixel->x + 0.5) * per_step, larger, columns);
  const auto [top, bottom] = covered((pixel->y + 0.5) * per_step, larger, rows);
  return {left, right, top, bottom};
}

TEST(WarpedNodes, MatchTheRuleWithEveryInstructionSet) {
  reference::Random random(11);
  int seen = 0, not_seen = 0, many = 0;
  for (int round = 0; round < 40; round++) {
    const auto lens = [&](bool distorted) {
      const double f = random.uniform(80, 200);
      if (!distorted) return Lens(LensModel::kPinhole, {f, f * 1.01, 70, 50});
      if (round % 5 == 1)
        return Lens(LensModel::kThinPrismFisheye,
                    {f / 2, f / 2, 70, 50, random.uniform(-0.05, 0.05), 0.01, 1e-3, -2e-3, 1e-3, 1e-4, 2e-3, 3e-3});
      if (round % 5 == 2)
        return Lens(LensModel::kFullOpenCv,
                    {f, f, 70, 50, random.uniform(0.2, 0.5), 0.05, 1e-3, -2e-3, 0.01, 0.3, 0.05, 0.01});
      return Lens(LensModel::kOpenCv,
                  {f, f, 70, 50, random.uniform(-0.3, 0.1), random.uniform(-0.02, 0.05), 1e-3, -2e-3});
    };
    View from;
    from.width = 150 - 3 * round;
    from.height = 50;
    from.lens = lens(round % 4 == 1);
    const auto map = test::level_surface(from.width, from.height, round % 3 == 0 ? 0 : 0.1, random.uniform(0.5, 4), 0);
    for (uint8_t& level : map->levels) level = static_cast<uint8_t>(random.uniform(0, 256));
    from.focus.map = map;
    View to = from;
    to.lens = round % 2 ? lens(round % 3 == 1) : from.lens;
    to.pose.position = {random.uniform(-0.2, 0.2), random.uniform(-0.2, 0.2), random.uniform(-1, 1)};
    to.pose.orientation =
        glm::angleAxis(round % 8 == 5 ? 3 : 0.05, glm::normalize(Vec3(random.uniform(-1, 1), 1, 0.3)));
    const int columns = round % 5 == 0 ? 7 : map->columns, rows = 12;
    test::on_every_target([&] {
      WarpedNodes nodes(from, to, columns, rows);
      for (int j = 0; j < map->rows; j++) {
        const WarpedNodes::Row row = nodes.row(j);
        for (int i = 0; i < map->columns; i++) {
          const Covered is{row.left[i], row.right[i], row.top[i], row.bottom[i]};
          const Covered rule = plain(from, to, columns, rows, i, j);
          EXPECT_EQ(is, rule) << round << ": " << i << ", " << j;
          const int area = std::max(rule.right - rule.left, 0) * std::max(rule.bottom - rule.top, 0);
          seen += area > 0;
          not_seen += area == 0;
          many += area > 1;
        }
      }
    });
  }
  EXPECT_GT(seen, 10000);
  EXPECT_GT(not_seen, 10000);
  EXPECT_GT(many, 1000);
}

// A wall 4 m in front of the plane z = 0, and a wall at 1 m that covers x > 0.
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
  constexpr int kBorder = 5;  // nodes; unseen parts may come into view at the border
  int wrong = 0, all = 0;
  for (int j = kBorder; j < truth.rows - kBorder; j++)
    for (int i = kBorder; i < truth.columns - kBorder; i++, all++)
      wrong += carried.levels[j * truth.columns + i] != truth.levels[j * truth.columns + i];
  return static_cast<double>(wrong) / all;
}

TEST(WarpDepthMap, KeepsTheMapOfTheSameView) {
  const View view = two_walls({0, 0, 0});
  EXPECT_EQ(warp_depth_map(view, view), view.focus.map);
}

TEST(WarpDepthMap, ReturnsNullForTooLargeViews) {
  const View from = two_walls({0, 0, 0});
  View to = from;
  to.width = to.height = 4096;
  EXPECT_EQ(warp_depth_map(from, to)->levels.size(), FocalMap::kMaxNodes);
  to.width++;
  EXPECT_EQ(warp_depth_map(from, to), nullptr);
}

TEST(WarpDepthMap, FollowsTheViewpoint) {
  const View from = two_walls({0, 0, 0});
  for (const Vec3& eye : {Vec3(0.1, 0, 0), Vec3(-0.1, 0, 0), Vec3(0, 0.05, 0.2), Vec3(0.03, 0.02, -0.3)}) {
    const View to = two_walls(eye);
    const std::shared_ptr<const FocalMap> carried = warp_depth_map(from, to);
    // A column of nodes along the depth edge may be one node off.
    EXPECT_LE(share_of_wrong_nodes(*carried, *to.focus.map), 1.01 / 30) << eye.x << ", " << eye.z;
    if (std::abs(eye.x) > 0.05) {
      EXPECT_GT(share_of_wrong_nodes(*from.focus.map, *to.focus.map), 1.01 / 30) << "something had to move";
    }
  }
}

TEST(WarpDepthMap, FollowsTheOrientation) {
  const View from = two_walls({0, 0, 0});
  View to = from;
  to.pose.orientation = glm::angleAxis(4 / 160., Vec3(0, 1, 0));
  const std::shared_ptr<const FocalMap> carried = warp_depth_map(from, to);
  const auto edge = [](const FocalMap& map) {
    const auto row = map.levels.begin() + 10 * map.columns;
    return std::adjacent_find(row, row + map.columns, std::not_equal_to<>()) - row;
  };
  EXPECT_EQ(edge(*carried), edge(*from.focus.map) - 1);
}

TEST(WarpDepthMap, InvisibleSurfacesBecomeFar) {
  const View from = two_walls({0, 0, 0});
  View to = from;
  to.pose.orientation = glm::angleAxis(M_PI, Vec3(0, 1, 0));
  EXPECT_EQ(warp_depth_map(from, to)->levels, std::vector<uint8_t>(40 * 30, 0));
  to = from;
  to.width = 40;
  to.height = 30;
  to.lens = Lens::pinhole(40, 19.5, 14.5);
  EXPECT_EQ(warp_depth_map(from, to)->levels.size(), 10u * 8);
}

}  // namespace

}  // namespace lf
