// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/delaunay.h"

#include <numeric>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/triangles.h"

namespace lf {

namespace {

TEST(Triangle, LowestFirstKeepsTheTurn) {
  EXPECT_EQ(lowest_first({1, 2, 3}), (Triangle{1, 2, 3}));
  EXPECT_EQ(lowest_first({3, 1, 2}), (Triangle{1, 2, 3}));
  EXPECT_EQ(lowest_first({2, 3, 1}), (Triangle{1, 2, 3}));
  EXPECT_EQ(lowest_first({3, 2, 1}), (Triangle{1, 3, 2}));
  EXPECT_EQ(lowest_first({5, 4, 4}), (Triangle{4, 4, 5}));
}

using test::expect_planar;
using test::twice_area;
using test::twice_hull_area;
using testing::ElementsAre;
using testing::IsEmpty;

std::vector<IntPoint> random_points(std::mt19937& random, int count, int range) {
  std::uniform_int_distribution<int> coordinate(-range, range);
  std::vector<IntPoint> points;
  for (int i = 0; i < count; ++i) points.push_back({coordinate(random), coordinate(random)});
  return points;
}

// The definition: no point inside any circumcircle, and the triangles cover the convex hull once.
void expect_delaunay(const std::vector<IntPoint>& points, const std::vector<Triangle>& triangles) {
  for (const Triangle& t : triangles) {
    for (const IntPoint p : points) ASSERT_LE(in_circle(points[t[0]], points[t[1]], points[t[2]], p), 0);
  }
  expect_planar(points, triangles);
  EXPECT_EQ(twice_area(points, triangles), twice_hull_area(points));
  EXPECT_TRUE(std::is_sorted(triangles.begin(), triangles.end()));
  for (const Triangle& t : triangles) EXPECT_EQ(t[0], std::min({t[0], t[1], t[2]}));
}

// The unique answer by brute force: every empty circle, and of the points on it the fan from the lowest index.
std::vector<Triangle> brute_force(const std::vector<IntPoint>& points) {
  std::set<Triangle> result;
  const CameraIndex n = points.size();
  std::vector<CameraIndex> distinct;
  for (CameraIndex i = 0; i < n; ++i) {
    const auto same = [&](CameraIndex j) { return points[j] == points[i]; };
    if (std::none_of(distinct.begin(), distinct.end(), same)) distinct.push_back(i);
  }
  for (const CameraIndex a : distinct) {
    for (const CameraIndex b : distinct) {
      for (const CameraIndex c : distinct) {
        if (b <= a || c <= a || orientation(points[a], points[b], points[c]) <= 0) continue;
        bool in_result = true;
        for (const CameraIndex d : distinct) {
          if (d == a || d == b || d == c) continue;
          const int inside = in_circle(points[a], points[b], points[c], points[d]);
          // (a, b, c) is in the fan from a if a is the lowest on the circle and no other is between b and c.
          const bool between = orientation(points[b], points[c], points[d]) < 0;
          if (inside > 0 || (inside == 0 && (d < a || between))) in_result = false;
        }
        if (in_result) result.insert({a, b, c});
      }
    }
  }
  return {result.begin(), result.end()};
}

TEST(Delaunay, RandomPointsMeetTheDefinition) {
  std::mt19937 random(3);
  for (int trial = 0; trial < 60; ++trial) {
    const auto points = random_points(random, 3 + trial, kMaxCoordinate);
    expect_delaunay(points, delaunay(points));
    EXPECT_EQ(delaunay(points), brute_force(points));
  }
}

// A small range makes many cocircular, collinear and coincident points.
TEST(Delaunay, DegeneratePointsHaveTheOneAnswerOfBruteForce) {
  std::mt19937 random(4);
  for (int trial = 0; trial < 1500; ++trial) {
    const auto points = random_points(random, 3 + trial % 20, 1 + trial % 5);
    ASSERT_EQ(delaunay(points), brute_force(points)) << "trial " << trial;
  }
  for (int trial = 0; trial < 20; ++trial) {
    const auto points = random_points(random, 60, 4);
    const auto triangles = delaunay(points);
    ASSERT_EQ(triangles, brute_force(points)) << "trial " << trial;
    expect_delaunay(points, triangles);
  }
}

TEST(Delaunay, RegularGridsTakeTheDiagonalWithTheLowestIndex) {
  for (const auto& [rows, columns] : {std::pair{2, 2}, {2, 7}, {5, 2}, {8, 8}, {17, 31}, {32, 32}}) {
    std::vector<IntPoint> points;
    for (int i = 0; i < rows * columns; ++i) points.push_back({i % columns * 1000, i / columns * 777});
    std::vector<Triangle> expected;
    for (CameraIndex row = 0; row + 1 < static_cast<CameraIndex>(rows); ++row) {
      for (CameraIndex column = 0; column + 1 < static_cast<CameraIndex>(columns); ++column) {
        const CameraIndex a = row * columns + column, below = a + columns;
        expected.push_back({a, a + 1, below + 1});
        expected.push_back({a, below + 1, below});
      }
    }
    EXPECT_EQ(delaunay(points), expected) << rows << " x " << columns;
  }
}

TEST(Delaunay, ShuffledGridsTakeItToo) {
  std::mt19937 random(5);
  for (int trial = 0; trial < 10; ++trial) {
    std::vector<IntPoint> points;
    for (int i = 0; i < 64; ++i) points.push_back({i % 8 * 10, i / 8 * 10});
    std::shuffle(points.begin(), points.end(), random);
    EXPECT_EQ(delaunay(points), brute_force(points));
  }
}

TEST(Delaunay, ManyPointsOnOneCircleMakeAFan) {
  // The 12 integer points at distance 5 from the origin, in order around it.
  const std::vector<IntPoint> circle{{5, 0},  {4, 3},   {3, 4},   {0, 5},  {-3, 4}, {-4, 3},
                                     {-5, 0}, {-4, -3}, {-3, -4}, {0, -5}, {3, -4}, {4, -3}};
  std::vector<Triangle> fan;
  for (CameraIndex i = 1; i < 11; ++i) fan.push_back({0, i, i + 1});
  EXPECT_EQ(delaunay(circle), fan);
  std::mt19937 random(6);
  for (int trial = 0; trial < 50; ++trial) {
    auto shuffled = circle;
    std::shuffle(shuffled.begin(), shuffled.end(), random);
    EXPECT_EQ(delaunay(shuffled), brute_force(shuffled));
  }
}

TEST(Delaunay, RenumberingRenamesTheTriangles) {
  std::mt19937 random(7);
  const auto points = random_points(random, 200, kMaxCoordinate);
  const auto triangles = delaunay(points);
  std::vector<CameraIndex> new_index(points.size());
  std::iota(new_index.begin(), new_index.end(), 0);
  std::shuffle(new_index.begin(), new_index.end(), random);
  std::vector<IntPoint> renumbered(points.size());
  for (size_t i = 0; i < points.size(); ++i) renumbered[new_index[i]] = points[i];
  std::vector<Triangle> expected;
  for (const Triangle& t : triangles)
    expected.push_back(lowest_first({new_index[t[0]], new_index[t[1]], new_index[t[2]]}));
  std::sort(expected.begin(), expected.end());
  EXPECT_EQ(delaunay(renumbered), expected);
}

TEST(Delaunay, OfCoincidentPointsTheLowestIndexCounts) {
  EXPECT_THAT(delaunay(std::vector<IntPoint>{{0, 0}, {0, 0}, {9, 0}, {0, 9}, {9, 0}}), ElementsAre(Triangle{0, 2, 3}));
}

TEST(Delaunay, PointsWithoutAreaHaveNoTriangles) {
  EXPECT_THAT(delaunay({}), IsEmpty());
  EXPECT_THAT(delaunay(std::vector<IntPoint>{{1, 1}}), IsEmpty());
  EXPECT_THAT(delaunay(std::vector<IntPoint>{{1, 1}, {2, 3}}), IsEmpty());
  EXPECT_THAT(delaunay(std::vector<IntPoint>{{1, 1}, {1, 1}, {1, 1}}), IsEmpty());
  EXPECT_THAT(delaunay(std::vector<IntPoint>{{0, 0}, {2, 4}, {1, 2}, {-5, -10}}), IsEmpty());
}

TEST(Delaunay, LongCollinearRunsAndSlivers) {
  std::vector<IntPoint> points;
  for (int i = 0; i < 200; ++i) points.push_back({i * 1000, 0});
  points.push_back({100000, 1});
  points.push_back({100000, -kMaxCoordinate});
  expect_delaunay(points, delaunay(points));
  std::vector<IntPoint> upright;  // one column, then a point on each side
  for (int i = 0; i < 50; ++i) upright.push_back({0, i * i});
  upright.push_back({-3, 7});
  upright.push_back({3, 7});
  expect_delaunay(upright, delaunay(upright));
}

}  // namespace

}  // namespace lf
