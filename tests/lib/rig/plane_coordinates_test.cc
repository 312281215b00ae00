// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/plane_coordinates.h"

#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "geometry/pose.h"
#include "support/expect_error.h"

namespace lf {

namespace {

constexpr int32_t kM = kMaxCoordinate;

TEST(Predicates, OrientationIsTwiceTheSignedAreaAtFullRange) {
  EXPECT_EQ(orientation({0, 0}, {1, 0}, {0, 1}), 1);
  EXPECT_EQ(orientation({-kM, -kM}, {kM, -kM}, {kM, kM}), int64_t{2 * kM} * 2 * kM);
  EXPECT_EQ(orientation({-kM, -kM}, {kM, kM}, {kM, -kM}), int64_t{-2 * kM} * 2 * kM);
  // A hair off a diagonal of the full range: doubles of the products would still tell, floats would not.
  EXPECT_EQ(orientation({-kM, -kM}, {0, 0}, {kM, kM}), 0);
  EXPECT_EQ(orientation({-kM, -kM}, {0, 0}, {kM - 1, kM}), kM);
}

TEST(Predicates, InCircleIsExactAtFullRange) {
  EXPECT_EQ(in_circle({-kM, -kM}, {kM, -kM}, {kM, kM}, {-kM, kM}), 0);
  EXPECT_EQ(in_circle({-kM, -kM}, {kM, -kM}, {kM, kM}, {-kM + 1, kM}), 1);
  EXPECT_EQ(in_circle({-kM, -kM}, {kM, -kM}, {kM - 1, kM}, {-kM, kM}), -1);
  EXPECT_EQ(in_circle({-kM, -kM}, {kM, -kM}, {kM, kM}, {0, 0}), 1);
}

TEST(Predicates, ClosedTriangleHasItsBorder) {
  EXPECT_TRUE(in_closed_triangle({0, 0}, {4, 0}, {0, 4}, {1, 1}));
  EXPECT_TRUE(in_closed_triangle({0, 0}, {4, 0}, {0, 4}, {2, 2}));
  EXPECT_TRUE(in_closed_triangle({0, 0}, {4, 0}, {0, 4}, {4, 0}));
  EXPECT_FALSE(in_closed_triangle({0, 0}, {4, 0}, {0, 4}, {3, 2}));
}

TEST(Predicates, TouchingSegmentsDoNotCross) {
  EXPECT_TRUE(cross_properly({0, 0}, {4, 4}, {0, 4}, {4, 0}));
  EXPECT_FALSE(cross_properly({0, 0}, {4, 4}, {2, 2}, {4, 0}));
  EXPECT_FALSE(cross_properly({0, 0}, {4, 4}, {4, 4}, {4, 0}));
  EXPECT_FALSE(cross_properly({0, 0}, {4, 4}, {1, 1}, {8, 8}));
  EXPECT_FALSE(cross_properly({0, 0}, {4, 4}, {9, 0}, {0, 9}));
}

std::vector<Vec3> grid(int rows, int columns, double pitch_x, double pitch_y, const Pose& pose = {}) {
  std::vector<Vec3> points;
  for (int i = 0; i < rows * columns; ++i) {
    points.push_back(pose.world_from_camera({i % columns * pitch_x, i / columns * pitch_y, 0}));
  }
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

TEST(PlaneCoordinates, SizeAndPlaceDoNotMatter) {
  const auto reference = plane_points(grid(6, 9, 0.125, 0.25), {1, 0, 0}, {0, 0, 1});
  for (const double pitch : {0x1p-1020, 0x1p-20, 0x1p20, 0x1p1010}) {
    EXPECT_EQ(plane_points(grid(6, 9, pitch / 2, pitch), {1, 0, 0}, {0, 0, 1}), reference) << pitch;
  }
  const Pose far_away{{1e6, -1e6, 1e6}, {1, 0, 0, 0}};
  EXPECT_EQ(plane_points(grid(6, 9, 0.125, 0.25, far_away), {1, 0, 0}, {0, 0, 1}), reference);
  // Baselines of a micrometre at a million metres: 8590 doubles from camera to camera.
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

TEST(PlaneCoordinates, PrincipalAxesAreThoseOfTheSpread) {
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  std::vector<Vec3> points;
  for (int i = 0; i < 2000; ++i) {
    points.push_back(kTilted.world_from_camera({normal(random), 5 * normal(random), 0.01 * normal(random)}));
  }
  const PlaneAxes axes = principal_axes(points);
  EXPECT_GT(std::abs(glm::dot(axes.x, kTilted.down())), 0.999);
  EXPECT_GT(std::abs(glm::dot(axes.normal, kTilted.forward())), 0.99999);
  EXPECT_NEAR(glm::dot(axes.x, axes.normal), 0, 1e-15);
  EXPECT_NEAR(glm::length(glm::cross(axes.x, axes.y) - axes.normal), 0, 1e-15);
  EXPECT_NEAR(glm::length(axes.x), 1, 1e-15);
}

TEST(PlaneCoordinates, PrincipalAxesOfALineAndOfNothing) {
  const Vec3 direction = glm::normalize(Vec3(1, -2, 0.3));
  const PlaneAxes line = principal_axes(std::vector<Vec3>{direction * 3.0, direction * -1.0, direction * 0.25});
  EXPECT_NEAR(std::abs(glm::dot(line.x, direction)), 1, 1e-15);
  EXPECT_NEAR(glm::dot(line.normal, direction), 0, 1e-15);
  const PlaneAxes none = principal_axes(std::vector<Vec3>{Vec3(4), Vec3(4)});
  EXPECT_NEAR(glm::length(glm::cross(none.x, none.y) - none.normal), 0, 1e-15);
}

TEST(PlaneCoordinates, BestFitPlaneFacesForward) {
  const auto points = grid(3, 3, 1, 1, kTilted);
  for (const double sign : {1.0, -1.0}) {
    const PlaneAxes axes = best_fit_plane(points, kTilted.right() * 9.0, kTilted.forward() * sign);
    EXPECT_NEAR(glm::length(axes.normal - kTilted.forward() * sign), 0, 1e-14);
    EXPECT_NEAR(glm::length(axes.x - kTilted.right()), 0, 1e-14);
  }
  // Cameras whose right axes cancel (a ring that looks inwards): the direction of largest spread.
  const PlaneAxes ring = best_fit_plane(grid(2, 5, 1, 1), {0, 0, 0}, {0, 0, 1});
  EXPECT_NEAR(std::abs(ring.x.x), 1, 1e-15);
}

TEST(PlaneCoordinates, PlaneWithNormalIsOrthonormalForEveryNormal) {
  for (const Vec3& normal :
       {Vec3(0, 0, 1e-200), Vec3(3, 0, 0), Vec3(0, -2, 0), Vec3(1, 1, 1), Vec3(-1e200, 1e200, 0)}) {
    const PlaneAxes axes = plane_with_normal(normal, {});
    EXPECT_NEAR(glm::length(axes.normal), 1, 1e-15);
    EXPECT_NEAR(glm::length(axes.x), 1, 1e-15);
    EXPECT_NEAR(glm::dot(axes.x, axes.normal), 0, 1e-15);
    EXPECT_NEAR(glm::length(glm::cross(axes.x, axes.y) - axes.normal), 0, 1e-15);
  }
}

TEST(PlaneCoordinates, OnOneLineComparesHeightWithTolerance) {
  EXPECT_TRUE(on_one_line({0, 0, 0}, {1, 0, 0}, {0.5, 0.9e-6, 0}, 1e-6));
  EXPECT_FALSE(on_one_line({0, 0, 0}, {1, 0, 0}, {0.5, 1.1e-6, 0}, 1e-6));
  EXPECT_TRUE(on_one_line({0, 0, 0}, {0, 0, 0}, {0, 1, 0}, 1e-6));
  EXPECT_TRUE(on_one_line({0, 0, 0}, {0, 0, 0}, {0, 0, 0}, 1e-6));
}

TEST(PlaneCoordinates, NamesTheCameraThatIsNotFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  EXPECT_ERROR(normalised_centres(std::vector<Vec3>{{0, 0, 0}, {0, nan, 0}}), "cameras[1].position");
  EXPECT_ERROR(normalised_centres(std::vector<Vec3>{{inf, 0, 0}, {0, 0, 0}}), "cameras[0].position");
}

}  // namespace

}  // namespace lf
