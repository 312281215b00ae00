// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/depth_edges.h"

#include "support/test.h"

namespace lf {
namespace {

// A map of 3 x 2 nodes with inverse distances 0 to 255.
FocalMap map_of(std::vector<uint8_t> levels) {
  FocalMap map = FocalMap::for_view(12, 8);
  map.farthest = 0;
  map.nearest = 255;
  map.levels = std::move(levels);
  return map;
}

TEST(DepthEdges, AreWhereTheCornersAreApart) {
  const DepthEdges edges(map_of({10, 12, 50, 10, 10, 10}), 5);
  EXPECT_EQ(edges.columns, 4);
  EXPECT_EQ(edges.rows, 3);
  EXPECT_EQ(edges.index, (std::vector<int32_t>{-1, -1, 0, -1,  // nothing is beyond the border
                                               -1, -1, 1, 2,   //
                                               -1, -1, -1, -1}));
  EXPECT_EQ(edges.cells.size(), 3u);
  EXPECT_TRUE(DepthEdges(map_of({10, 12, 50, 10, 10, 10}), 40).cells.empty());
}

TEST(DepthEdges, AreLimitedInNumber) {
  FocalMap map = FocalMap::for_view(2400, 2400);
  map.farthest = 0;
  map.nearest = 255;
  for (int j = 0; j < map.rows; j++)
    for (int i = 0; i < map.columns; i++)  // small edges everywhere, and a large edge in the middle
      map.levels.push_back(static_cast<uint8_t>(10 * ((i + j) % 2) + (i < map.columns / 2 ? 0 : 100)));
  const DepthEdges edges(map, 0);
  EXPECT_EQ(edges.cells.size(), static_cast<size_t>(edges.rows));
  for (int j = 0; j < edges.rows; j++) EXPECT_GE(edges.index_of(map.columns / 2, j), 0);
}

TEST(DepthEdges, EachPixelBelongsToOneCell) {
  const DepthEdges edges(map_of({0, 0, 0, 0, 0, 0}), 1);
  std::vector<int> seen(12 * 8);
  for (int j = 0; j < edges.rows; j++)
    for (int i = 0; i < edges.columns; i++)
      for (int k = 0; k < DepthEdges::kPixels; k++) {
        const auto [x, y] = DepthEdges::pixel_of(i, j, k);
        if (x < 0 || y < 0 || x >= 12 || y >= 8) continue;
        EXPECT_EQ(DepthEdges::cell_of(x), i);
        EXPECT_EQ(DepthEdges::cell_of(y), j);
        EXPECT_EQ(DepthEdges::in_cell(y) * DepthEdges::kSize + DepthEdges::in_cell(x), k);
        seen[static_cast<size_t>(12 * y + x)]++;
      }
  EXPECT_EQ(seen, std::vector<int>(12 * 8, 1));
}

TEST(DepthEdges, DepthAtFindsThePixel) {
  DepthEdges edges(map_of({0, 0, 100, 0, 0, 100}), 5);
  for (int k = 0; k < DepthEdges::kPixels; k++) edges.cells[1][k] = static_cast<float>(k);
  // The edge is between the columns 1 and 2 of the nodes, from pixel 6 on. The first row of cells has two rows of
  // pixels.
  EXPECT_EQ(edges.depth_at(5, 4), nullptr);
  ASSERT_NE(edges.depth_at(6, 2), nullptr);
  EXPECT_EQ(*edges.depth_at(6, 2), 0);
  EXPECT_EQ(*edges.depth_at(9, 3), 7);
  EXPECT_EQ(edges.depth_at(10, 3), nullptr);
}

// The depth of a surface is interpolated between its own corners only.
TEST(DepthEdges, SidesAreInterpolatedSeparately) {
  const struct {
    std::array<uint8_t, 4> corners;  // upper left, upper right, lower left, lower right
    int pixel;
  } kCases[] = {{{100, 0, 100, 0}, 5}, {{100, 10, 80, 10}, 0}, {{100, 10, 80, 10}, 15},
                {{0, 0, 0, 200}, 3},   {{100, 90, 80, 0}, 12}, {{20, 100, 100, 100}, 0}};
  for (const auto& test : kCases) {
    const FocalMap map = map_of({test.corners[0], test.corners[1], 0, test.corners[2], test.corners[3], 0});
    const auto [near, far] = DepthEdges::Sides(map, 1, 1).inverse_at(test.pixel);
    // The weights of the corners at the pixel, in 64ths.
    const int u = 2 * (test.pixel % 4) + 1, v = 2 * (test.pixel / 4) + 1;
    const std::array weights{(8 - u) * (8 - v), u * (8 - v), (8 - u) * v, u * v};
    std::array<double, 2> sum{}, weight{};
    for (size_t k = 0; k < 4; k++) {
      const size_t side = test.corners[k] > 50 ? 0 : 1;
      sum[side] += weights[k] * test.corners[k];
      weight[side] += weights[k];
    }
    EXPECT_NEAR(near, sum[0] / weight[0], 1e-12);
    EXPECT_NEAR(far, sum[1] / weight[1], 1e-12);
  }
}

}  // namespace
}  // namespace lf
