// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/triangulation.h"
#include "geometry/pose.h"
#include "support/expect_error.h"
#include "support/rigs.h"
#include "support/test.h"

namespace lf {
namespace {

using namespace test;
using testing::SizeIs;

constexpr int32_t kM = kMaxCoordinate;

TEST(Predicates, OrientationIsTwiceTheSignedAreaAtFullRange) {
  EXPECT_EQ(orientation({0, 0}, {1, 0}, {0, 1}), 1);
  EXPECT_EQ(orientation({-kM, -kM}, {kM, -kM}, {kM, kM}), int64_t{2 * kM} * 2 * kM);
  EXPECT_EQ(orientation({-kM, -kM}, {kM, kM}, {kM, -kM}), int64_t{-2 * kM} * 2 * kM);
  // Just off a diagonal of the full range: products in double still distinguish the sides, float does not.
  EXPECT_EQ(orientation({-kM, -kM}, {0, 0}, {kM, kM}), 0);
  EXPECT_EQ(orientation({-kM, -kM}, {0, 0}, {kM - 1, kM}), kM);
}

TEST(Predicates, InCircleIsExactAtFullRange) {
  EXPECT_EQ(in_circle({-kM, -kM}, {kM, -kM}, {kM, kM}, {-kM, kM}), 0);
  EXPECT_EQ(in_circle({-kM, -kM}, {kM, -kM}, {kM, kM}, {-kM + 1, kM}), 1);
  EXPECT_EQ(in_circle({-kM, -kM}, {kM, -kM}, {kM - 1, kM}, {-kM, kM}), -1);
  EXPECT_EQ(in_circle({-kM, -kM}, {kM, -kM}, {kM, kM}, {0, 0}), 1);
}

TEST(Predicates, TriangleContainsItsBorder) {
  EXPECT_TRUE(triangle_contains({0, 0}, {4, 0}, {0, 4}, {1, 1}));
  EXPECT_TRUE(triangle_contains({0, 0}, {4, 0}, {0, 4}, {2, 2}));
  EXPECT_TRUE(triangle_contains({0, 0}, {4, 0}, {0, 4}, {4, 0}));
  EXPECT_FALSE(triangle_contains({0, 0}, {4, 0}, {0, 4}, {3, 2}));
}

TEST(Predicates, TouchingSegmentsDoNotCross) {
  EXPECT_TRUE(segments_cross({0, 0}, {4, 4}, {0, 4}, {4, 0}));
  EXPECT_FALSE(segments_cross({0, 0}, {4, 4}, {2, 2}, {4, 0}));
  EXPECT_FALSE(segments_cross({0, 0}, {4, 4}, {4, 4}, {4, 0}));
  EXPECT_FALSE(segments_cross({0, 0}, {4, 4}, {1, 1}, {8, 8}));
  EXPECT_FALSE(segments_cross({0, 0}, {4, 4}, {9, 0}, {0, 9}));
}

std::vector<Vec3> grid(int rows, int columns, double pitch_x, double pitch_y, const Pose& pose = {}) {
  std::vector<Vec3> points;
  for (int i = 0; i < rows * columns; ++i)
    points.push_back(pose.world_from_camera({i % columns * pitch_x, i / columns * pitch_y, 0}));
  return points;
}

std::vector<IntPoint> plane_points(const std::vector<Vec3>& positions, const Vec3& right, const Vec3& forward) {
  const CameraCentres centres = normalised_centres(positions);
  const double n = static_cast<double>(positions.size());
  const PlaneAxes axes = best_fit_plane(centres.at, right * n, forward * n);
  std::vector<IntPoint> points;
  for (const Vec3& c : centres.at) points.push_back(quantise(c, axes, centres.quantum));
  return points;
}

// Cameras of one column have the same x, of one row the same y; x grows with the column and y with the row.
void expect_rectangular(const std::vector<IntPoint>& points, int rows, int columns) {
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const IntPoint p = points[row * columns + column];
      EXPECT_EQ(p.x, points[column].x);
      EXPECT_EQ(p.y, points[row * columns].y);
      EXPECT_TRUE(column == 0 || p.x > points[column - 1].x);
      EXPECT_TRUE(row == 0 || p.y > points[(row - 1) * columns].y);
    }
  }
}

const Pose kTilted{{0.3, -4, 7}, glm::normalize(Quat(0.3, -0.7, 0.2, 0.6))};

TEST(PlaneCoordinates, GridsStayRectangularAtAnyTilt) {
  expect_rectangular(plane_points(grid(7, 5, 0.1, 0.07), {1, 0, 0}, {0, 0, 1}), 7, 5);
  expect_rectangular(plane_points(grid(7, 5, 0.1, 0.07, kTilted), kTilted.right(), kTilted.forward()), 7, 5);
  expect_rectangular(plane_points(grid(8, 8, 0.1, 0.1, kTilted), kTilted.right(), kTilted.forward()), 8, 8);
}

TEST(PlaneCoordinates, DoNotDependOnSizeAndPosition) {
  const auto reference = plane_points(grid(6, 9, 0.125, 0.25), {1, 0, 0}, {0, 0, 1});
  for (const double pitch : {0x1p-1020, 0x1p-20, 0x1p20, 0x1p1010})
    EXPECT_EQ(plane_points(grid(6, 9, pitch / 2, pitch), {1, 0, 0}, {0, 0, 1}), reference) << pitch;
  const Pose far_away{{1e6, -1e6, 1e6}, {1, 0, 0, 0}};
  EXPECT_EQ(plane_points(grid(6, 9, 0.125, 0.25, far_away), {1, 0, 0}, {0, 0, 1}), reference);
  // A pitch of a micrometre at a million metres: 8590 units in the last place per pitch.
  const auto tiny = plane_points(grid(6, 9, 1e-6, 2e-6, far_away), {1, 0, 0}, {0, 0, 1});
  expect_rectangular(tiny, 6, 9);
}

TEST(PlaneCoordinates, ResolutionIsTwentyTwoBitsOfTheArray) {
  const auto points = plane_points(grid(1, 2, 0.3, 0), {1, 0, 0}, {0, 0, 1});
  EXPECT_GE(points[1].x - points[0].x, 1 << 22);
  EXPECT_EQ(points[1].y, points[0].y);
}

TEST(PlaneCoordinates, ExtremesStayWithinRange) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::vector<Vec3> cube;
  for (int i = 0; i < 8; ++i) cube.push_back(Vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1) * 1.7e308);
  const CameraCentres centres = normalised_centres(cube);
  for (int trial = 0; trial < 1000; ++trial) {
    const PlaneAxes axes = plane_with_normal({unit(random), unit(random), unit(random)}, {});
    for (const Vec3& c : centres.at) {
      const IntPoint p = quantise(c, axes, centres.quantum);
      EXPECT_LE(std::abs(p.x), kMaxCoordinate);
      EXPECT_LE(std::abs(p.y), kMaxCoordinate);
    }
  }
}

void expect_orthonormal(const PlaneAxes& axes) {
  EXPECT_NEAR(glm::length(axes.normal), 1, 1e-15);
  EXPECT_NEAR(glm::length(axes.x), 1, 1e-15);
  EXPECT_NEAR(glm::dot(axes.x, axes.normal), 0, 1e-15);
  EXPECT_NEAR(glm::length(glm::cross(axes.x, axes.y) - axes.normal), 0, 1e-15);
}

TEST(PlaneCoordinates, PrincipalAxesFollowTheSpread) {
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  std::vector<Vec3> points;
  for (int i = 0; i < 2000; ++i)
    points.push_back(kTilted.world_from_camera({normal(random), 5 * normal(random), 0.01 * normal(random)}));
  const PlaneAxes axes = principal_axes(points);
  EXPECT_GT(std::abs(glm::dot(axes.x, kTilted.down())), 0.999);
  EXPECT_GT(std::abs(glm::dot(axes.normal, kTilted.forward())), 0.99999);
  expect_orthonormal(axes);
}

TEST(PlaneCoordinates, PrincipalAxesOfALineAndOfNothing) {
  const Vec3 direction = glm::normalize(Vec3(1, -2, 0.3));
  const PlaneAxes line = principal_axes(std::vector<Vec3>{direction * 3.0, direction * -1.0, direction * 0.25});
  EXPECT_NEAR(std::abs(glm::dot(line.x, direction)), 1, 1e-15);
  EXPECT_NEAR(glm::dot(line.normal, direction), 0, 1e-15);
  expect_orthonormal(principal_axes(std::vector<Vec3>{Vec3(4), Vec3(4)}));
}

TEST(PlaneCoordinates, BestFitPlaneFacesForward) {
  const auto points = grid(3, 3, 1, 1, kTilted);
  for (const double sign : {1.0, -1.0}) {
    const PlaneAxes axes = best_fit_plane(points, kTilted.right() * 9.0, kTilted.forward() * sign);
    EXPECT_NEAR(glm::length(axes.normal - kTilted.forward() * sign), 0, 1e-14);
    EXPECT_NEAR(glm::length(axes.x - kTilted.right()), 0, 1e-14);
  }
  // In an inward-looking ring the cameras' right axes cancel: the fit uses the direction of largest spread.
  const PlaneAxes ring = best_fit_plane(grid(2, 5, 1, 1), {0, 0, 0}, {0, 0, 1});
  EXPECT_NEAR(std::abs(ring.x.x), 1, 1e-15);
}

TEST(PlaneCoordinates, PlaneWithNormalIsOrthonormalForEveryNormal) {
  for (const Vec3& normal : {Vec3(0, 0, 1e-200), Vec3(3, 0, 0), Vec3(0, -2, 0), Vec3(1, 1, 1), Vec3(-1e200, 1e200, 0)})
    expect_orthonormal(plane_with_normal(normal, {}));
}

TEST(PlaneCoordinates, OnOneLineComparesHeightWithTolerance) {
  EXPECT_TRUE(are_collinear({0, 0, 0}, {1, 0, 0}, {0.5, 0.9e-6, 0}, 1e-6));
  EXPECT_FALSE(are_collinear({0, 0, 0}, {1, 0, 0}, {0.5, 1.1e-6, 0}, 1e-6));
  EXPECT_TRUE(are_collinear({0, 0, 0}, {0, 0, 0}, {0, 1, 0}, 1e-6));
  EXPECT_TRUE(are_collinear({0, 0, 0}, {0, 0, 0}, {0, 0, 0}, 1e-6));
}

TEST(PlaneCoordinates, NamesTheCameraThatIsNotFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  EXPECT_ERROR(normalised_centres(std::vector<Vec3>{{0, 0, 0}, {0, nan, 0}}), "cameras[1].position");
  EXPECT_ERROR(normalised_centres(std::vector<Vec3>{{inf, 0, 0}, {0, 0, 0}}), "cameras[0].position");
}

TEST(Triangle, CanonicalTriangleKeepsTheOrientation) {
  EXPECT_EQ(canonical_triangle({1, 2, 3}), (Triangle{1, 2, 3}));
  EXPECT_EQ(canonical_triangle({3, 1, 2}), (Triangle{1, 2, 3}));
  EXPECT_EQ(canonical_triangle({2, 3, 1}), (Triangle{1, 2, 3}));
  EXPECT_EQ(canonical_triangle({3, 2, 1}), (Triangle{1, 3, 2}));
  EXPECT_EQ(canonical_triangle({5, 4, 4}), (Triangle{4, 4, 5}));
}

std::vector<IntPoint> random_points(std::mt19937& random, int count, int range) {
  std::uniform_int_distribution<int> coordinate(-range, range);
  std::vector<IntPoint> points;
  for (int i = 0; i < count; ++i) points.push_back({coordinate(random), coordinate(random)});
  return points;
}

// By definition, no circumcircle contains a point, and the triangles cover the convex hull once.
void expect_delaunay(const std::vector<IntPoint>& points, const std::vector<Triangle>& triangles) {
  for (const Triangle& t : triangles)
    for (const IntPoint p : points) ASSERT_LE(in_circle(points[t[0]], points[t[1]], points[t[2]], p), 0);
  expect_planar(points, triangles);
  EXPECT_EQ(twice_area(points, triangles), twice_hull_area(points));
  EXPECT_TRUE(std::is_sorted(triangles.begin(), triangles.end()));
  for (const Triangle& t : triangles) EXPECT_EQ(t[0], std::min({t[0], t[1], t[2]}));
}

// Computes the unique result by brute force: all empty circles, with a fan from the lowest index of the points on each
// circle.
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
          // (a, b, c) is in the fan from a if a is the lowest index on the circle and no point is between b and c.
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
TEST(Delaunay, DegeneratePointsMatchBruteForce) {
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

// The 12 integer points at distance 5 from the origin, in order of angle.
const std::vector<IntPoint> kCircle{{5, 0},  {4, 3},   {3, 4},   {0, 5},  {-3, 4}, {-4, 3},
                                    {-5, 0}, {-4, -3}, {-3, -4}, {0, -5}, {3, -4}, {4, -3}};

TEST(Delaunay, ManyPointsOnOneCircleMakeAFan) {
  std::vector<Triangle> fan;
  for (CameraIndex i = 1; i < 11; ++i) fan.push_back({0, i, i + 1});
  EXPECT_EQ(delaunay(kCircle), fan);
}

TEST(Delaunay, ShuffledGridsAndCirclesMatchBruteForce) {
  std::mt19937 random(5);
  for (std::vector<IntPoint> points : {grid_points(8, 8, 10), kCircle}) {
    for (int trial = 0; trial < 50; ++trial) {
      std::shuffle(points.begin(), points.end(), random);
      ASSERT_EQ(delaunay(points), brute_force(points)) << points.size() << " points, trial " << trial;
    }
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
    expected.push_back(canonical_triangle({new_index[t[0]], new_index[t[1]], new_index[t[2]]}));
  std::sort(expected.begin(), expected.end());
  EXPECT_EQ(delaunay(renumbered), expected);
}

TEST(Delaunay, UsesTheLowestOfCoincidentPoints) {
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

// Returns the parts of the link of camera 9, such as "ring 1 2 3, chain 4 5 6".
std::string link_of_9(const std::vector<Triangle>& star) {
  std::string parts;
  for (const LinkPart& part : camera_link(star, 9)) {
    parts += std::string(parts.empty() ? "" : ", ") + (part.closed ? "ring" : "chain");
    for (const CameraIndex camera : part.camera) parts += " " + std::to_string(camera);
  }
  return parts;
}

TEST(Link, IsARingInsideAndAChainAtTheBorder) {
  EXPECT_EQ(link_of_9({{1, 2, 9}, {9, 3, 4}, {2, 3, 9}, {4, 1, 9}}), "ring 1 2 3 4");
  EXPECT_EQ(link_of_9({{2, 3, 9}, {3, 4, 9}, {1, 2, 9}}), "chain 1 2 3 4");
  EXPECT_EQ(link_of_9({{3, 2, 9}, {1, 2, 9}, {3, 4, 9}}), "chain 4 3 2 1") << "oriented as the first triangle";
  EXPECT_EQ(link_of_9({{1, 2, 9}, {2, 3, 9}, {4, 5, 9}, {5, 6, 9}, {6, 4, 9}}), "chain 1 2 3, ring 4 5 6");
}

TEST(Link, IsEmptyWithoutASurface) {
  EXPECT_EQ(link_of_9({}), "");
  EXPECT_EQ(link_of_9({{1, 2, 9}}), "");
  EXPECT_EQ(link_of_9({{1, 2, 9}, {1, 2, 9}}), "");
  EXPECT_EQ(link_of_9({{1, 1, 9}, {9, 9, 2}}), "");
  EXPECT_EQ(link_of_9({{1, 2, 9}, {2, 3, 9}, {2, 4, 9}}), "") << "three triangles at one edge";
}

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

TEST(EarClipping, SquareIsClippedAtTheLowestTip) {
  EXPECT_THAT(clip_ears(outline({{0, 0}, {9, 0}, {9, 9}, {0, 9}}, true), {}),
              ElementsAre(Triangle{0, 1, 3}, Triangle{1, 2, 3}));
  Outline turned = outline({{0, 0}, {9, 0}, {9, 9}, {0, 9}}, true);
  turned.camera = {7, 3, 5, 4};
  EXPECT_THAT(clip_ears(turned, {}), ElementsAre(Triangle{3, 5, 7}, Triangle{4, 7, 5}));
}

TEST(EarClipping, WellShapedEarsAreClippedFirst) {
  // A kite: uses the short diagonal, wherever tip 0 is.
  EXPECT_THAT(clip_ears(outline({{-100, 0}, {0, -10}, {100, 0}, {0, 10}}, true), {}),
              ElementsAre(Triangle{0, 1, 3}, Triangle{1, 2, 3}));
  EXPECT_THAT(clip_ears(outline({{0, -10}, {100, 0}, {0, 10}, {-100, 0}}, true), {}),
              ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}));
}

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
  for (const Triangle& t : ears)
    for (const IntPoint p : points) EXPECT_LE(in_circle(points[t[0]], points[t[1]], points[t[2]], p), 0);
}

TEST(EarClipping, ChainsAreFilledUpToAStraightBorder) {
  // A bay of depth 10 between 0 and 3, traversed with the bay on the left.
  const std::vector<IntPoint> bay{{20, 0}, {20, 10}, {0, 10}, {0, 0}};
  EXPECT_THAT(clip_ears(outline(bay, false), {}), ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}));
  // The reversed chain is convex: there is no hole.
  EXPECT_THAT(clip_ears(outline({bay.rbegin(), bay.rend()}, false), {}), IsEmpty());
  EXPECT_THAT(clip_ears(outline({{0, 0}, {5, 0}, {9, 0}}, false), {}), IsEmpty());
}

TEST(EarClipping, ChainsAvoidTheSurroundingMesh) {
  const std::vector<IntPoint> corner{{10, 0}, {0, 0}, {0, -10}};  // the bay is the triangle of these points
  ASSERT_THAT(clip_ears(outline(corner, false), {}), SizeIs(1));
  const auto with = [&](const MeshEdge& edge) { return clip_ears(outline(corner, false), std::vector{edge}); };
  EXPECT_THAT(with({7, 8, {3, -3}, {50, -50}}), IsEmpty());  // a camera inside
  EXPECT_THAT(with({7, 8, {5, -5}, {50, -50}}), IsEmpty());
  EXPECT_THAT(with({7, 8, {50, -50}, {-50, 45}}), IsEmpty());
  EXPECT_THAT(with({7, 8, {6, -6}, {50, -50}}), SizeIs(1));
  EXPECT_THAT(with({7, 8, {0, 0}, {-50, 50}}), SizeIs(1));  // at the position of a corner
  EXPECT_THAT(with({2, 0, {0, -10}, {10, 0}}), IsEmpty());  // this side has a triangle already
  EXPECT_THAT(with({0, 2, {10, 0}, {0, -10}}), SizeIs(1));
}

TEST(EarClipping, HandlesSelfIntersectingOutlines) {
  std::mt19937 random(9);
  std::uniform_int_distribution<int> coordinate(-6, 6);
  for (int trial = 0; trial < 500; ++trial) {
    std::vector<IntPoint> points;
    for (int i = 0; i < 3 + trial % 12; ++i) points.push_back({coordinate(random), coordinate(random)});
    for (const Triangle& t : clip_ears(outline(points, trial % 2), {})) ASSERT_GT(twice_area(points, t), 0);
  }
}

struct Array {
  std::vector<Triangle> faces;
  CameraCentres centres;
  PlaneAxes plane;

  Array(const std::vector<Triangle>& faces, const std::vector<Vec3>& positions)
      : faces(faces), centres(normalised_centres(positions)), plane(principal_axes(centres.at)) {}
  Array& without(std::initializer_list<CameraIndex> cameras) {
    for (const CameraIndex camera : cameras) remove_camera(faces, camera, centres, plane);
    return *this;
  }
};

std::vector<Vec3> positions(const std::vector<IntPoint>& points) {
  std::vector<Vec3> result;
  for (const IntPoint p : points) result.emplace_back(p.x, p.y, 0);
  return result;
}

Array grid(int rows, int columns) { return {grid_faces(rows, columns), positions(grid_points(rows, columns))}; }

TEST(HoleFilling, CamerasOfGrids) {
  EXPECT_THAT(grid(3, 3).without({4}).faces, ElementsAre(Triangle{0, 1, 3}, Triangle{5, 8, 7}, Triangle{1, 2, 5},
                                                         Triangle{1, 5, 3}, Triangle{3, 5, 7}, Triangle{3, 7, 6}));
  EXPECT_THAT(grid(2, 3).without({1}).faces, ElementsAre(Triangle{2, 5, 4}, Triangle{0, 4, 3}, Triangle{0, 2, 4}))
      << "a straight border";
  EXPECT_THAT(grid(2, 2).without({0}).faces, ElementsAre(Triangle{1, 3, 2})) << "cuts the corner";
  EXPECT_THAT(grid(2, 2).without({1}).faces, ElementsAre(Triangle{0, 3, 2}));
}

TEST(HoleFilling, NewTrianglesKeepTheOrientation) {
  Array turned = grid(3, 3);
  for (Triangle& t : turned.faces) std::swap(t[1], t[2]);
  const auto points = grid_points(3, 3);
  for (const Triangle& t : turned.without({4, 1}).faces) EXPECT_LT(twice_area(points, t), 0);
  EXPECT_EQ(twice_area(points, turned.faces), -8'000'000);
}

TEST(HoleFilling, OrientationOfTrianglesDoesNotMatter) {
  Array mixed = grid(3, 3);
  std::swap(mixed.faces[1][1], mixed.faces[1][2]);
  std::swap(mixed.faces[6][0], mixed.faces[6][1]);
  EXPECT_THAT(mixed.without({4}).faces, SizeIs(6));
}

TEST(HoleFilling, BaysAvoidOtherParts) {
  // Face 4 is the tip of a spit that reaches into the bay of camera 0; chain 3, 2, 1 surrounds the spit.
  const std::vector<Triangle> faces{{0, 3, 2}, {0, 2, 1}, {4, 5, 6}};
  const auto with_spit_at = [&](double y) {
    return std::vector<Vec3>{{0, 10, 0}, {-10, 0, 0}, {0, -10, 0}, {10, 0, 0}, {0, y, 0}, {-1, 30, 0}, {1, 30, 0}};
  };
  EXPECT_THAT(Array(faces, with_spit_at(12)).without({0}).faces, ElementsAre(Triangle{4, 5, 6}, Triangle{1, 3, 2}));
  EXPECT_THAT(Array(faces, with_spit_at(-5)).without({0}).faces, ElementsAre(Triangle{4, 5, 6}));
}

// rows x columns cameras on a vertical cylinder; with `full`, the last column meets the first.
Array cylinder(int rows, int columns, bool full) {
  std::vector<Vec3> places;
  std::vector<Triangle> faces;
  const CameraIndex n = columns;
  for (int i = 0; i < rows * columns; ++i) {
    const double angle = (full ? 2 * M_PI : M_PI) * (i % columns) / columns;
    places.emplace_back(std::cos(angle), 0.3 * (i / columns), std::sin(angle));
  }
  for (CameraIndex row = 0; row + 1 < static_cast<CameraIndex>(rows); ++row) {
    for (CameraIndex column = 0; column + (full ? 0 : 1) < n; ++column) {
      const CameraIndex a = row * n + column, b = row * n + (column + 1) % n;
      faces.push_back({a, b, a + n});
      faces.push_back({b, b + n, a + n});
    }
  }
  return {faces, places};
}

TEST(HoleFilling, CurvedArraysAreFilledInTheirLocalPlanes) {
  for (const bool full : {false, true}) {
    const Array whole = cylinder(6, 16, full);
    for (CameraIndex camera = 0; camera < 96; ++camera) {
      if (!full && (camera % 16 == 0 || camera % 16 == 15)) continue;
      Array array = whole;
      array.without({camera});
      // Two faces fewer inside; one fewer at a rim: its bay is filled although the far side of the ring is behind.
      const bool rim = camera < 16 || camera >= 80;
      EXPECT_THAT(array.faces, SizeIs(whole.faces.size() - (rim ? 1 : 2))) << camera << (full ? " of a ring" : "");
      std::set<std::pair<CameraIndex, CameraIndex>> edges;
      for (const Triangle& t : array.faces)
        for (int k = 0; k < 3; ++k) EXPECT_TRUE(edges.insert({t[k], t[(k + 1) % 3]}).second);
    }
  }
}

TEST(HoleFilling, HubOfAThousandSpokes) {
  std::vector<Vec3> places;
  std::vector<Triangle> faces;
  constexpr CameraIndex kSpokes = 1023;
  for (CameraIndex i = 0; i < kSpokes; ++i) {
    const double angle = 2 * M_PI * i / kSpokes;
    places.emplace_back(std::cos(angle), std::sin(angle), 0);
    faces.push_back({i, (i + 1) % kSpokes, kSpokes});
  }
  places.emplace_back(0.1, 0.2, 0);
  EXPECT_THAT(Array(faces, places).without({kSpokes}).faces, SizeIs(kSpokes - 2));
}

TEST(HoleFilling, FillsPartsThatMeetOnlyInTheCamera) {
  const std::vector<Vec3> places{{0, 0, 0},   {10, -5, 0}, {12, 0, 0},  {10, 5, 0},
                                 {-10, 5, 0}, {-12, 0, 0}, {-10, -5, 0}};
  const std::vector<Triangle> faces{{0, 1, 2}, {0, 2, 3}, {0, 4, 5}, {0, 5, 6}};
  EXPECT_THAT(Array(faces, places).without({0}).faces, ElementsAre(Triangle{1, 2, 3}, Triangle{4, 5, 6}));
}

TEST(HoleFilling, NonManifoldMeshesStayOpen) {
  const auto places = positions({{0, 0}, {10, 0}, {0, 10}, {-10, 0}, {0, -10}});
  EXPECT_THAT(Array({{0, 1, 2}, {0, 2, 3}, {0, 2, 4}, {1, 2, 3}}, places).without({0}).faces,
              ElementsAre(Triangle{1, 2, 3}));
  EXPECT_THAT(Array({{0, 1, 2}, {0, 1, 2}}, places).without({0}).faces, IsEmpty());
  EXPECT_THAT(Array({{0, 0, 1}, {1, 1, 2}}, places).without({0}).faces, ElementsAre(Triangle{1, 1, 2}));
}

TEST(HoleFilling, TrianglesWithoutAreaLeaveNothingToFill) {
  const auto places = positions({{0, 0}, {10, 0}, {20, 0}, {30, 0}, {40, 0}});
  EXPECT_THAT(Array({{0, 1, 2}, {2, 1, 3}, {2, 3, 4}, {2, 4, 0}}, places).without({2}).faces, IsEmpty());
}

TEST(HoleFilling, HandlesArbitraryTriangles) {
  std::mt19937 random(10);
  for (int trial = 0; trial < 300; ++trial) {
    const CameraIndex n = 4 + trial % 12;
    std::uniform_int_distribution<CameraIndex> pick(0, n - 1);
    std::uniform_int_distribution<int> coordinate(-3, 3);
    std::vector<Vec3> places;
    for (CameraIndex i = 0; i < n; ++i) places.emplace_back(coordinate(random), coordinate(random), coordinate(random));
    std::vector<Triangle> faces;
    for (int i = 0; i < 40; ++i) faces.push_back({pick(random), pick(random), pick(random)});
    Array array(faces, places);
    for (CameraIndex camera = 0; camera < n; ++camera) {
      array.without({camera});
      for (const Triangle& t : array.faces) EXPECT_GT(std::min({t[0], t[1], t[2]}), camera);
    }
    EXPECT_THAT(array.faces, IsEmpty());
  }
}

}  // namespace
}  // namespace lf
