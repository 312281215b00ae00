// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/hole_filling.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>

#include "support/triangles.h"

namespace lf {
namespace {

using test::expect_planar;
using test::twice_area;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

Outline outline(const std::vector<IntPoint>& points, bool closed) {
  Outline result{std::vector<CameraIndex>(points.size()), points, closed};
  std::iota(result.camera.begin(), result.camera.end(), 0);
  return result;
}

int64_t twice_polygon_area(const std::vector<IntPoint>& p) {
  int64_t sum = 0;
  for (size_t i = 1; i + 1 < p.size(); ++i) sum += orientation(p[0], p[i], p[i + 1]);
  return sum;
}

TEST(EarClipping, SquareIsCutAtTheLowestTip) {
  EXPECT_THAT(clip_ears(outline({{0, 0}, {9, 0}, {9, 9}, {0, 9}}, true), {}),
              ElementsAre(Triangle{0, 1, 3}, Triangle{1, 2, 3}));
  Outline turned = outline({{0, 0}, {9, 0}, {9, 9}, {0, 9}}, true);
  turned.camera = {7, 3, 5, 4};
  EXPECT_THAT(clip_ears(turned, {}), ElementsAre(Triangle{3, 5, 7}, Triangle{4, 7, 5}));
}

TEST(EarClipping, WellShapedEarsGoFirst) {
  // A kite: the short diagonal, whether tip 0 is at the end of it or not.
  EXPECT_THAT(clip_ears(outline({{-100, 0}, {0, -10}, {100, 0}, {0, 10}}, true), {}),
              ElementsAre(Triangle{0, 1, 3}, Triangle{1, 2, 3}));
  EXPECT_THAT(clip_ears(outline({{0, -10}, {100, 0}, {0, 10}, {-100, 0}}, true), {}),
              ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}));
}

// Star-shaped outlines with bays and flat corners, any start.
TEST(EarClipping, PolygonsAreFilledExactly) {
  std::mt19937 random(8);
  std::uniform_int_distribution<int> radius(1, 12);
  for (int trial = 0; trial < 300; ++trial) {
    std::vector<IntPoint> points;
    const int n = 3 + trial % 30;
    for (int i = 0; i < n; ++i) {
      const double angle = 2 * M_PI * (i + 0.3) / n, r = 100.0 * radius(random);
      points.push_back({static_cast<int>(r * std::cos(angle)), static_cast<int>(r * std::sin(angle))});
    }
    if (trial % 2) {  // a flat corner in the middle of each side
      std::vector<IntPoint> finer;
      for (int i = 0; i < n; ++i) {
        const IntPoint a = points[i], b = points[(i + 1) % n];
        finer.push_back({2 * a.x, 2 * a.y});
        finer.push_back({a.x + b.x, a.y + b.y});
      }
      points = finer;
    }
    std::rotate(points.begin(), points.begin() + trial % n, points.end());
    const auto ears = clip_ears(outline(points, true), {});
    ASSERT_THAT(ears, SizeIs(points.size() - 2));
    expect_planar(points, ears);
    EXPECT_EQ(twice_area(points, ears), twice_polygon_area(points));
  }
}

TEST(EarClipping, ConvexPolygonsBecomeDelaunay) {
  std::vector<IntPoint> points;  // on an ellipse
  for (int i = 0; i < 25; ++i) {
    const double angle = 2 * M_PI * i / 25;
    points.push_back({static_cast<int>(30000 * std::cos(angle)), static_cast<int>(12345 * std::sin(angle))});
  }
  const auto ears = clip_ears(outline(points, true), {});
  ASSERT_THAT(ears, SizeIs(23));
  for (const Triangle& t : ears) {
    for (const IntPoint p : points) EXPECT_LE(in_circle(points[t[0]], points[t[1]], points[t[2]], p), 0);
  }
}

TEST(EarClipping, ChainsAreFilledUpToAStraightBorder) {
  // A bay of depth 10 between 0 and 3, walked with the bay on the left.
  const std::vector<IntPoint> bay{{20, 0}, {20, 10}, {0, 10}, {0, 0}};
  EXPECT_THAT(clip_ears(outline(bay, false), {}), ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}));
  // The same chain the other way is a cape: nothing to fill.
  EXPECT_THAT(clip_ears(outline({bay.rbegin(), bay.rend()}, false), {}), IsEmpty());
  EXPECT_THAT(clip_ears(outline({{0, 0}, {5, 0}, {9, 0}}, false), {}), IsEmpty());
}

TEST(EarClipping, ChainsKeepClearOfTheMeshAround) {
  const std::vector<IntPoint> corner{{10, 0}, {0, 0}, {0, -10}};  // the bay is the triangle of the three
  ASSERT_THAT(clip_ears(outline(corner, false), {}), SizeIs(1));
  const auto with = [&](const MeshEdge& edge) { return clip_ears(outline(corner, false), std::vector{edge}); };
  EXPECT_THAT(with({7, 8, {3, -3}, {50, -50}}), IsEmpty());    // a camera inside
  EXPECT_THAT(with({7, 8, {5, -5}, {50, -50}}), IsEmpty());    // on the new edge
  EXPECT_THAT(with({7, 8, {50, -50}, {-50, 45}}), IsEmpty());  // an edge across
  EXPECT_THAT(with({7, 8, {6, -6}, {50, -50}}), SizeIs(1));
  EXPECT_THAT(with({7, 8, {0, 0}, {-50, 50}}), SizeIs(1));  // at the place of a corner
  EXPECT_THAT(with({2, 0, {0, -10}, {10, 0}}), IsEmpty());  // there is a triangle on this side already
  EXPECT_THAT(with({0, 2, {10, 0}, {0, -10}}), SizeIs(1));  // on the other side
}

TEST(EarClipping, OutlinesThatCrossThemselvesEnd) {
  std::mt19937 random(9);
  std::uniform_int_distribution<int> coordinate(-6, 6);
  for (int trial = 0; trial < 500; ++trial) {
    std::vector<IntPoint> points;
    for (int i = 0; i < 3 + trial % 12; ++i) points.push_back({coordinate(random), coordinate(random)});
    for (const Triangle& t : clip_ears(outline(points, trial % 2), {})) ASSERT_GT(twice_area(points, t), 0);
  }
}

}  // namespace
}  // namespace lf
