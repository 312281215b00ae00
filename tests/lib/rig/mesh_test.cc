// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/mesh.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "rig/delaunay.h"
#include "support/expect_error.h"
#include "support/mesh_rigs.h"
#include "support/triangles.h"

namespace lf {
namespace {

using test::as_grid;
using test::as_triangles;
using test::corners;
using test::expect_planar;
using test::grid_faces;
using test::grid_points;
using test::random_set;
using test::rig_at;
using test::twice_area;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr CameraIndex kNone = MeshFace::kNone;

bool contains_any(const Triangle& t, const CameraSet& set) {
  return std::any_of(t.begin(), t.end(), [&](CameraIndex i) { return std::binary_search(set.begin(), set.end(), i); });
}

TEST(MeshOfGrid, EachCellIsSplitAsTheRuleSays) {
  EXPECT_THAT(corners(build_mesh(as_grid(rig_at(grid_points(2, 3)), 2, 3))),
              ElementsAre(Triangle{0, 1, 3}, Triangle{1, 4, 3}, Triangle{1, 2, 4}, Triangle{2, 5, 4}));
  for (const auto& [rows, columns] : {std::pair{2, 2}, {2, 9}, {7, 2}, {8, 8}, {5, 11}, {16, 16}, {32, 32}}) {
    const Rig rig = as_grid(rig_at(grid_points(rows, columns, 1000, 400)), rows, columns);
    EXPECT_EQ(corners(build_mesh(rig)), grid_faces(rows, columns)) << rows << " x " << columns;
  }
}

// The corners of the array in service: whatever else is lost, the whole rectangle stays covered, once.
TEST(MeshOfGrid, LossesInsideTheCornersLeaveNoGap) {
  std::mt19937 random(11);
  for (int trial = 0; trial < 60; ++trial) {
    const int rows = 2 + trial % 7, columns = 2 + trial % 9;
    const CameraIndex n = rows * columns;
    const auto points = grid_points(rows, columns);
    const Rig rig = as_grid(rig_at(points), rows, columns);
    CameraSet lost = random_set(random, n, n * (1 + trial % 3) / 4);
    std::erase_if(
        lost, [&](CameraIndex i) { return i == 0 || i == CameraIndex(columns - 1) || i == n - columns || i == n - 1; });
    const auto faces = corners(build_mesh(rig, lost));
    expect_planar(points, faces);
    EXPECT_EQ(twice_area(points, faces), 2'000'000ll * (rows - 1) * (columns - 1)) << "trial " << trial;
    EXPECT_TRUE(std::none_of(faces.begin(), faces.end(), [&](const Triangle& t) { return contains_any(t, lost); }));
  }
}

TEST(CornersOfArrays, AreThoseOfTheirHull) {
  EXPECT_THAT(corner_cameras(as_grid(rig_at(grid_points(3, 4)), 3, 4)), ElementsAre(0, 3, 8, 11));
  EXPECT_THAT(corner_cameras(rig_at(grid_points(1, 5))), ElementsAre(0, 4));
  EXPECT_THAT(corner_cameras(rig_at(grid_points(1, 1))), ElementsAre(0));
  EXPECT_THAT(corner_cameras({}), IsEmpty());
  auto twice = grid_points(3, 3);
  twice.push_back(twice[8]);
  EXPECT_THAT(corner_cameras(rig_at(twice)), ElementsAre(0, 2, 6, 8));
}

TEST(CornersOfArrays, StayInTheMeshWhereThreeCamerasWork) {
  EXPECT_THAT(out_of_mesh({0, 4, 5}, {0, 2, 6, 8}, 9), ElementsAre(4, 5));
  EXPECT_THAT(out_of_mesh({0, 1, 3, 4, 5, 6}, {0, 2, 6, 8}, 9), ElementsAre(1, 3, 4, 5));
  EXPECT_THAT(out_of_mesh({0, 1, 3, 4, 5, 6, 7}, {0, 2, 6, 8}, 9), ElementsAre(0, 1, 3, 4, 5, 6, 7)) << "a strip";
}

// Whatever is lost, up to three quarters: all that three cameras surround is seen by one that works, and more.
TEST(CornersOfArrays, MakeTheMeshCoverAllThatWasCovered) {
  std::mt19937 random(13);
  for (int trial = 0; trial < 200; ++trial) {
    const int rows = 2 + trial % 7, columns = 3 + trial % 6;
    const CameraIndex n = rows * columns;
    const auto points = grid_points(rows, columns, 1000, trial % 2 ? 0 : 300);
    const Rig rig = trial % 3 ? as_grid(rig_at(points), rows, columns) : rig_at(points);
    const CameraSet lost = random_set(random, n, n * (1 + trial % 3) / 4);
    const auto before = corners(build_mesh(rig, lost));
    if (std::ranges::any_of(before, [](const Triangle& t) { return t[2] == kNone; })) continue;  // strips
    const auto now = corners(build_mesh(rig, out_of_mesh(lost, corner_cameras(rig), n)));
    const auto has = [&](const std::vector<Triangle>& faces, IntPoint p) {
      return std::ranges::any_of(faces, [&](const Triangle& t) {
        const bool is_seen =
            std::ranges::any_of(t, [&](CameraIndex i) { return !std::ranges::binary_search(lost, i); });
        const bool turns = orientation(points[t[0]], points[t[1]], points[t[2]]) > 0;
        return is_seen && in_closed_triangle(points[t[0]], points[turns ? t[1] : t[2]], points[turns ? t[2] : t[1]], p);
      });
    };
    int seen_before = 0, seen_now = 0;
    for (int k = 0; k < 300; ++k) {
      const IntPoint p{static_cast<int>(random() % (1000 * (columns - 1))),
                       static_cast<int>(random() % (1000 * (rows - 1)))};
      const bool was = has(before, p), is = has(now, p);
      EXPECT_TRUE(is || !was) << "trial " << trial << ": " << p.x << ", " << p.y;
      seen_before += was;
      seen_now += is;
    }
    EXPECT_GE(seen_now, seen_before);
  }
}

TEST(MeshOfGrid, JitteredGridsStayPlanarWhateverIsLost) {
  std::mt19937 random(12);
  for (int trial = 0; trial < 60; ++trial) {
    const int rows = 2 + trial % 8, columns = 2 + trial % 7;
    const CameraIndex n = rows * columns;
    const auto points = grid_points(rows, columns, 1000, 240, trial);
    const CameraSet lost = random_set(random, n, n * (1 + trial % 5) / 6);
    const Rig rig = as_grid(rig_at(points), rows, columns);
    const Mesh mesh = build_mesh(rig, lost);
    if (mesh.faces.empty() || mesh.faces[0].corners() < 3) continue;  // too few left
    const auto faces = corners(mesh);
    expect_planar(points, faces);
    EXPECT_TRUE(std::none_of(faces.begin(), faces.end(), [&](const Triangle& t) { return contains_any(t, lost); }));
  }
}

TEST(MeshOfGrid, InnerHolesAreFilledCompletelyAndOldFacesComeFirst) {
  std::mt19937 random(13);
  for (int trial = 0; trial < 40; ++trial) {
    const auto points = grid_points(9, 8, 1000, 240, trial);
    const Rig rig = as_grid(rig_at(points), 9, 8);
    CameraSet lost = random_set(random, 72, 2 + trial);
    std::erase_if(lost, [](CameraIndex i) { return i < 8 || i >= 64 || i % 8 == 0 || i % 8 == 7; });
    const auto faces = corners(build_mesh(rig, lost)), whole = grid_faces(9, 8);
    expect_planar(points, faces);
    EXPECT_EQ(twice_area(points, faces), twice_area(points, whole));
    EXPECT_EQ(faces.size(), whole.size() - 2 * lost.size());
    std::vector<Triangle> kept;
    for (const Triangle& t : whole) {
      if (!contains_any(t, lost)) kept.push_back(t);
    }
    ASSERT_GE(faces.size(), kept.size());
    EXPECT_TRUE(std::equal(kept.begin(), kept.end(), faces.begin()));
    for (size_t i = kept.size(); i < faces.size(); ++i) EXPECT_EQ(faces[i], lowest_first(faces[i]));
  }
}

TEST(MeshOfGrid, LosingACornerCutsItOnly) {
  for (const CameraIndex corner : {0, 3, 12, 15}) {
    const auto points = grid_points(4, 4);
    const auto faces = corners(build_mesh(as_grid(rig_at(points), 4, 4), {corner}));
    expect_planar(points, faces);
    EXPECT_EQ(twice_area(points, faces), 18'000'000 - 1'000'000);
  }
}

TEST(MeshOfGrid, SizePlaceAndTiltDoNotMatter) {
  const auto points = grid_points(6, 7);
  const CameraSet lost{3, 9, 10, 20, 41};
  const auto expected = corners(build_mesh(as_grid(rig_at(points), 6, 7), lost));
  for (const double pitch : {0x1p-20, 0x1p-30, 1.0, 0x1p40}) {
    for (const Vec3& place : {Vec3(0), Vec3(0x1p20, -0x1p20, 0x1p20)}) {
      if (place.x != 0 && pitch < 0x1p-25) continue;  // below the resolution of doubles there
      std::vector<Vec3> positions;
      for (const IntPoint p : points) positions.push_back(place + pitch / 1000 * Vec3(p.x, p.y, 0));
      EXPECT_EQ(corners(build_mesh(as_grid(rig_at(positions), 6, 7), lost)), expected) << pitch;
    }
  }
  const Pose tilted{{5, 6, 7}, glm::normalize(Quat(0.4, 0.5, -0.6, 0.1))};
  Rig rig = as_grid(rig_at(points), 6, 7);
  for (Camera& camera : rig.cameras) {
    camera.pose = {tilted.world_from_camera(camera.pose.position), tilted.orientation};
  }
  EXPECT_EQ(corners(build_mesh(rig, lost)), expected);
}

TEST(MeshOfGrid, LargeArraysWithManyLosses) {
  std::mt19937 random(14);
  const auto points = grid_points(32, 32, 1000, 200);
  const CameraSet lost = random_set(random, 1024, 300);
  const auto faces = corners(build_mesh(as_grid(rig_at(points), 32, 32), lost));
  for (const Triangle& t : faces) EXPECT_GT(twice_area(points, t), 0);
  EXPECT_GT(faces.size(), 2u * (1024 - 300) - 4u * 32);
}

TEST(MeshOfTriangles, FacesAreAsListed) {
  const std::vector<Triangle> listed{{2, 0, 1}, {1, 3, 2}, {1, 1, 2}};
  EXPECT_EQ(corners(build_mesh(as_triangles(rig_at(grid_points(2, 2)), listed))), listed);
}

TEST(MeshOfTriangles, HolesAreFilled) {
  const auto points = grid_points(3, 3);
  const Rig as_listed = as_triangles(rig_at(points), grid_faces(3, 3));
  EXPECT_EQ(corners(build_mesh(as_listed, {4})), corners(build_mesh(as_grid(rig_at(points), 3, 3), {4})));
}

TEST(MeshOfDelaunay, IsDelaunayOfTheCamerasInService) {
  std::mt19937 random(15);
  for (int trial = 0; trial < 20; ++trial) {
    const auto points = grid_points(6, 5, 1000, 480, trial);
    const CameraSet lost = random_set(random, 30, trial);
    std::vector<IntPoint> left;
    std::vector<CameraIndex> index;
    for (CameraIndex i = 0; i < 30; ++i) {
      if (std::binary_search(lost.begin(), lost.end(), i)) continue;
      left.push_back(points[i]);
      index.push_back(i);
    }
    auto expected = delaunay(left);
    for (Triangle& t : expected) t = {index[t[0]], index[t[1]], index[t[2]]};
    EXPECT_EQ(corners(build_mesh(rig_at(points), lost)), expected);
  }
}

TEST(MeshOfDelaunay, RegularGridsAtAnyTiltTakeTheDiagonalWithTheLowestIndex) {
  Rig rig = rig_at(grid_points(8, 8, 1));
  const Pose tilted{{5, 6, 7}, glm::normalize(Quat(0.4, 0.5, -0.6, 0.1))};
  std::vector<Triangle> expected;
  for (CameraIndex a = 0; a < 55; ++a) {
    if (a % 8 == 7) continue;
    expected.push_back({a, a + 1, a + 9});
    expected.push_back({a, a + 9, a + 8});
  }
  EXPECT_EQ(corners(build_mesh(rig)), expected);
  for (Camera& camera : rig.cameras) {
    camera.pose = {tilted.world_from_camera(camera.pose.position * 0.1), tilted.orientation};
  }
  EXPECT_EQ(corners(build_mesh(rig)), expected);
}

TEST(MeshOfDelaunay, RenumberingTheCamerasRenamesTheFaces) {
  std::mt19937 random(16);
  std::normal_distribution<double> normal;
  std::vector<Vec3> positions;
  for (int i = 0; i < 60; ++i) positions.emplace_back(normal(random), normal(random), 0.1 * normal(random));
  std::vector<CameraIndex> new_index(60);
  for (CameraIndex i = 0; i < 60; ++i) new_index[i] = i;
  std::shuffle(new_index.begin(), new_index.end(), random);
  std::vector<Vec3> renumbered(60);
  for (int i = 0; i < 60; ++i) renumbered[new_index[i]] = positions[i];
  std::vector<Triangle> expected;
  for (const Triangle& t : corners(build_mesh(rig_at(positions)))) {
    expected.push_back(lowest_first({new_index[t[0]], new_index[t[1]], new_index[t[2]]}));
  }
  std::sort(expected.begin(), expected.end());
  EXPECT_EQ(corners(build_mesh(rig_at(renumbered))), expected);
}

TEST(MeshOfDelaunay, OfCoincidentCamerasTheLowestInServiceCounts) {
  const Rig rig = rig_at(std::vector<IntPoint>{{0, 0}, {9, 0}, {0, 9}, {9, 0}});
  EXPECT_THAT(corners(build_mesh(rig)), ElementsAre(Triangle{0, 1, 2}));
  EXPECT_THAT(corners(build_mesh(rig, {1})), ElementsAre(Triangle{0, 3, 2}));
}

TEST(MeshOfDelaunay, ThousandAndTwentyFourCameras) {
  const auto points = grid_points(32, 32, 1000, 490);
  EXPECT_EQ(corners(build_mesh(rig_at(points))), delaunay(points));
}

// Every topology, wherever no triangle with area is left.
TEST(MeshWithoutTriangles, FewCameras) {
  EXPECT_THAT(build_mesh(rig_at(std::vector<IntPoint>{})).faces, IsEmpty());
  EXPECT_THAT(corners(build_mesh(rig_at(grid_points(1, 1)))), ElementsAre(Triangle{0, kNone, kNone}));
  EXPECT_THAT(corners(build_mesh(rig_at(grid_points(1, 2)))), ElementsAre(Triangle{0, 1, kNone}));
  EXPECT_THAT(corners(build_mesh(as_grid(rig_at(grid_points(1, 1)), 1, 1))), ElementsAre(Triangle{0, kNone, kNone}));
  EXPECT_THAT(corners(build_mesh(as_grid(rig_at(grid_points(3, 1, 9, 2)), 3, 1))),
              ElementsAre(Triangle{0, 1, kNone}, Triangle{1, 2, kNone}));
  const Rig square = rig_at(grid_points(2, 2));
  for (const Rig& rig : {square, as_grid(square, 2, 2), as_triangles(square, grid_faces(2, 2))}) {
    EXPECT_THAT(build_mesh(rig, {0, 1, 2, 3}).faces, IsEmpty());
    EXPECT_THAT(corners(build_mesh(rig, {0, 1, 2})), ElementsAre(Triangle{3, kNone, kNone}));
    EXPECT_THAT(corners(build_mesh(rig, {0, 3})), ElementsAre(Triangle{1, 2, kNone}));
    EXPECT_THAT(corners(build_mesh(rig, {0})), ElementsAre(Triangle{1, 3, 2}));
  }
}

TEST(MeshWithoutTriangles, CollinearCamerasAreStripsHoweverTheyLie) {
  const Vec3 direction = glm::normalize(Vec3(0.3, 0.7, 0.1));
  for (const double scale : {1e-6, 1.0, 1e6}) {
    for (const double distance : {0.0, 1e6}) {
      std::vector<Vec3> positions;
      for (const double at : {0.0, 0.31, 0.57, 0.58, 1.0, 1.31}) {
        positions.push_back(Vec3(distance, -distance, distance / 3) + scale * at * direction);
      }
      const Rig rig = rig_at(positions);
      const std::vector<Triangle> strips{{0, 1, kNone}, {1, 2, kNone}, {2, 3, kNone}, {3, 4, kNone}, {4, 5, kNone}};
      EXPECT_EQ(corners(build_mesh(rig)), strips) << scale << " at " << distance;
      EXPECT_EQ(corners(build_mesh(as_grid(rig, 2, 3))), strips);
      EXPECT_EQ(corners(build_mesh(as_triangles(rig, {{0, 1, 2}, {3, 4, 5}}))), strips);
      EXPECT_THAT(corners(build_mesh(rig, {1, 2, 5})), ElementsAre(Triangle{0, 3, kNone}, Triangle{3, 4, kNone}));
    }
  }
}

TEST(MeshWithoutTriangles, OneRowOrDiagonalLeftOfAnArray) {
  std::vector<Vec3> positions;
  for (int i = 0; i < 9; ++i) positions.emplace_back(0.1 * (i % 3), 0.07 * (i / 3), 0);
  for (const Rig& rig : {rig_at(positions), as_grid(rig_at(positions), 3, 3)}) {
    EXPECT_THAT(corners(build_mesh(rig, {0, 1, 2, 6, 7, 8})),
                ElementsAre(Triangle{3, 4, kNone}, Triangle{4, 5, kNone}));
    EXPECT_THAT(corners(build_mesh(rig, {1, 2, 3, 5, 6, 7})),
                ElementsAre(Triangle{0, 4, kNone}, Triangle{4, 8, kNone}));
  }
}

TEST(MeshWithoutTriangles, CoincidentCamerasAreOnePoint) {
  const Rig rig = rig_at(std::vector<Vec3>(4, Vec3(1e6, 2, 3)));
  for (const Rig& same : {rig, as_grid(rig, 2, 2), as_triangles(rig, {{1, 2, 3}})}) {
    EXPECT_THAT(corners(build_mesh(same)), ElementsAre(Triangle{0, kNone, kNone}));
    EXPECT_THAT(corners(build_mesh(same, {0})), ElementsAre(Triangle{1, kNone, kNone}));
  }
}

TEST(Mesh, OneTriangleWithAreaKeepsThoseWithout) {
  const Rig rig = as_triangles(rig_at(std::vector<IntPoint>{{0, 0}, {1, 0}, {2, 0}, {0, 1}}), {{0, 1, 2}, {0, 1, 3}});
  EXPECT_THAT(corners(build_mesh(rig)), ElementsAre(Triangle{0, 1, 2}, Triangle{0, 1, 3}));
}

TEST(Mesh, NamesWhatIsWrong) {
  const Rig square = rig_at(grid_points(2, 2));
  for (const Rig& rig : {square, as_grid(square, 2, 2), as_triangles(square, grid_faces(2, 2))}) {
    EXPECT_ERROR(build_mesh(rig, {4}), "there is no camera 4");
    EXPECT_ERROR(build_mesh(rig, {1, UINT32_MAX}), "there is no camera 4294967295");
  }
  EXPECT_ERROR(build_mesh(as_triangles(square, {{0, 1, 2}, {0, 1, 9}})), "topology.triangles[1][2]");
  EXPECT_ERROR(build_mesh(as_grid(square, 2, 3)), "2 rows x 3 columns");
  EXPECT_ERROR(build_mesh(as_grid(square, -2, -2)), "-2 rows");
  Rig nan = square;
  nan.cameras[2].pose.position.z = std::numeric_limits<double>::quiet_NaN();
  EXPECT_ERROR(build_mesh(nan), "cameras[2].position");
}

}  // namespace
}  // namespace lf
