// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/hole_filling.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>

#include "support/mesh_rigs.h"
#include "support/triangles.h"

namespace lf {
namespace {

using test::expect_planar;
using test::grid_faces;
using test::grid_points;
using test::twice_area;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

// A mesh, and what is left of it without cameras.
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

TEST(HoleFilling, InnerCamera) {
  EXPECT_THAT(grid(3, 3).without({4}).faces,
              ElementsAre(Triangle{0, 1, 3}, Triangle{5, 8, 7},  // stay
                          Triangle{1, 2, 5}, Triangle{1, 5, 3}, Triangle{3, 5, 7}, Triangle{3, 7, 6}));
}

TEST(HoleFilling, BorderCameraLeavesAStraightBorder) {
  EXPECT_THAT(grid(2, 3).without({1}).faces, ElementsAre(Triangle{2, 5, 4}, Triangle{0, 4, 3}, Triangle{0, 2, 4}));
}

TEST(HoleFilling, CornerCameraCutsTheCorner) {
  EXPECT_THAT(grid(2, 2).without({0}).faces, ElementsAre(Triangle{1, 3, 2}));  // had one triangle
  EXPECT_THAT(grid(2, 2).without({1}).faces, ElementsAre(Triangle{0, 3, 2}));  // had two
}

TEST(HoleFilling, NewTrianglesTurnAsTheOldOnes) {
  Array turned = grid(3, 3);
  for (Triangle& t : turned.faces) std::swap(t[1], t[2]);
  const auto points = grid_points(3, 3);
  for (const Triangle& t : turned.without({4, 1}).faces) EXPECT_LT(twice_area(points, t), 0);
  EXPECT_EQ(twice_area(points, turned.faces), -8'000'000);
}

TEST(HoleFilling, TrianglesListedEitherWayMakeTheSameHole) {
  Array mixed = grid(3, 3);
  std::swap(mixed.faces[1][1], mixed.faces[1][2]);
  std::swap(mixed.faces[6][0], mixed.faces[6][1]);
  EXPECT_THAT(mixed.without({4}).faces, SizeIs(6));
}

// A bay whose straight border would run over another part of the mesh.
TEST(HoleFilling, BayKeepsClearOfOtherParts) {
  // 4 is the tip of a spit that reaches into the bay of camera 0; chain 3, 2, 1 around it.
  const std::vector<Triangle> faces{{0, 3, 2}, {0, 2, 1}, {4, 5, 6}};
  const auto with_spit_at = [&](double y) {
    return std::vector<Vec3>{{0, 10, 0}, {-10, 0, 0}, {0, -10, 0}, {10, 0, 0}, {0, y, 0}, {-1, 30, 0}, {1, 30, 0}};
  };
  EXPECT_THAT(Array(faces, with_spit_at(12)).without({0}).faces, ElementsAre(Triangle{4, 5, 6}, Triangle{1, 3, 2}));
  EXPECT_THAT(Array(faces, with_spit_at(-5)).without({0}).faces, ElementsAre(Triangle{4, 5, 6}));
}

// rows x columns cameras on a cylinder with vertical axis; the last column meets the first where `full`.
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
      // Two less inside; one less at a rim, whose bay is filled although the far side is behind it.
      const bool rim = camera < 16 || camera >= 80;
      EXPECT_THAT(array.faces, SizeIs(whole.faces.size() - (rim ? 1 : 2))) << camera << (full ? " of a ring" : "");
      std::set<std::pair<CameraIndex, CameraIndex>> edges;
      for (const Triangle& t : array.faces) {
        for (int k = 0; k < 3; ++k) EXPECT_TRUE(edges.insert({t[k], t[(k + 1) % 3]}).second);
      }
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

TEST(HoleFilling, TwoPartsThatMeetInTheCameraAloneAreFilledEach) {
  // Two quarters of a wheel around camera 0.
  const std::vector<Vec3> places{{0, 0, 0},   {10, -5, 0}, {12, 0, 0},  {10, 5, 0},
                                 {-10, 5, 0}, {-12, 0, 0}, {-10, -5, 0}};
  const std::vector<Triangle> faces{{0, 1, 2}, {0, 2, 3}, {0, 4, 5}, {0, 5, 6}};
  EXPECT_THAT(Array(faces, places).without({0}).faces, ElementsAre(Triangle{1, 2, 3}, Triangle{4, 5, 6}));
}

TEST(HoleFilling, WhatIsNotASurfaceStaysOpen) {
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

TEST(HoleFilling, AnythingListedEnds) {
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
