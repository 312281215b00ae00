// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/mesh.h"
#include "rig/rig.h"
#include "rig/triangulation.h"
#include "support/expect_error.h"
#include "support/rigs.h"
#include "support/test.h"

namespace lf {
namespace {

using namespace test;

constexpr CameraIndex kNone = MeshFace::kNone;

bool contains_any(const Triangle& t, const CameraSet& set) {
  return std::any_of(t.begin(), t.end(), [&](CameraIndex i) { return std::binary_search(set.begin(), set.end(), i); });
}

TEST(MeshOfGrid, SplitsCellsByTheRule) {
  EXPECT_THAT(corners(build_mesh(as_grid(rig_at(grid_points(2, 3)), 2, 3))),
              ElementsAre(Triangle{0, 1, 3}, Triangle{1, 4, 3}, Triangle{1, 2, 4}, Triangle{2, 5, 4}));
  for (const auto& [rows, columns] : {std::pair{2, 2}, {2, 9}, {7, 2}, {8, 8}, {5, 11}, {16, 16}, {32, 32}}) {
    const Rig rig = as_grid(rig_at(grid_points(rows, columns, 1000, 400)), rows, columns);
    EXPECT_EQ(corners(build_mesh(rig)), grid_faces(rows, columns)) << rows << " x " << columns;
  }
}

// A loss inside the array never uncovers a part of the rectangle between its corners.
TEST(MeshOfGrid, InnerLossesLeaveNoGap) {
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

TEST(HullCameras, AreTheConvexHull) {
  EXPECT_THAT(hull_cameras(as_grid(rig_at(grid_points(3, 4)), 3, 4)), ElementsAre(0, 3, 8, 11));
  EXPECT_THAT(hull_cameras(rig_at(grid_points(1, 5))), ElementsAre(0, 4));
  EXPECT_THAT(hull_cameras(rig_at(grid_points(1, 1))), ElementsAre(0));
  EXPECT_THAT(hull_cameras({}), IsEmpty());
  auto twice = grid_points(3, 3);
  twice.push_back(twice[8]);
  EXPECT_THAT(hull_cameras(rig_at(twice)), ElementsAre(0, 2, 6, 8));
}

TEST(HullCameras, StayInTheMeshIfThreeCamerasWork) {
  EXPECT_THAT(mesh_exclusions({0, 4, 5}, {0, 2, 6, 8}, 9), ElementsAre(4, 5));
  EXPECT_THAT(mesh_exclusions({0, 1, 3, 4, 5, 6}, {0, 2, 6, 8}, 9), ElementsAre(1, 3, 4, 5));
  EXPECT_THAT(mesh_exclusions({0, 1, 3, 4, 5, 6, 7}, {0, 2, 6, 8}, 9), ElementsAre(0, 1, 3, 4, 5, 6, 7)) << "a strip";
}

// Loses up to three quarters of the cameras. Everything that three cameras surround stays covered by a working camera.
TEST(HullCameras, KeepTheCoveredArea) {
  std::mt19937 random(13);
  for (int trial = 0; trial < 200; ++trial) {
    const int rows = 2 + trial % 7, columns = 3 + trial % 6;
    const CameraIndex n = rows * columns;
    const auto points = grid_points(rows, columns, 1000, trial % 2 ? 0 : 300);
    const Rig rig = trial % 3 ? as_grid(rig_at(points), rows, columns) : rig_at(points);
    const CameraSet lost = random_set(random, n, n * (1 + trial % 3) / 4);
    const auto before = corners(build_mesh(rig, lost));
    if (std::ranges::any_of(before, [](const Triangle& t) { return t[2] == kNone; })) continue;
    const auto now = corners(build_mesh(rig, mesh_exclusions(lost, hull_cameras(rig), n)));
    const auto has = [&](const std::vector<Triangle>& faces, IntPoint p) {
      return std::ranges::any_of(faces, [&](const Triangle& t) {
        const bool is_seen =
            std::ranges::any_of(t, [&](CameraIndex i) { return !std::ranges::binary_search(lost, i); });
        const bool turns = orientation(points[t[0]], points[t[1]], points[t[2]]) > 0;
        return is_seen && triangle_contains(points[t[0]], points[turns ? t[1] : t[2]], points[turns ? t[2] : t[1]], p);
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

TEST(MeshOfGrid, JitteredGridsStayPlanarAfterLosses) {
  std::mt19937 random(12);
  for (int trial = 0; trial < 60; ++trial) {
    const int rows = 2 + trial % 8, columns = 2 + trial % 7;
    const CameraIndex n = rows * columns;
    const auto points = grid_points(rows, columns, 1000, 240, trial);
    const CameraSet lost = random_set(random, n, n * (1 + trial % 5) / 6);
    const Rig rig = as_grid(rig_at(points), rows, columns);
    const Mesh mesh = build_mesh(rig, lost);
    if (mesh.faces.empty() || mesh.faces[0].corners() < 3) continue;
    const auto faces = corners(mesh);
    expect_planar(points, faces);
    EXPECT_TRUE(std::none_of(faces.begin(), faces.end(), [&](const Triangle& t) { return contains_any(t, lost); }));
  }
}

TEST(MeshOfGrid, InnerHolesAreFilledAfterTheOldFaces) {
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
    for (const Triangle& t : whole)
      if (!contains_any(t, lost)) kept.push_back(t);
    ASSERT_GE(faces.size(), kept.size());
    EXPECT_TRUE(std::equal(kept.begin(), kept.end(), faces.begin()));
    for (size_t i = kept.size(); i < faces.size(); ++i) EXPECT_EQ(faces[i], canonical_triangle(faces[i]));
  }
}

TEST(MeshOfGrid, LosingACornerRemovesOnlyItsCell) {
  for (const CameraIndex corner : {0, 3, 12, 15}) {
    const auto points = grid_points(4, 4);
    const auto faces = corners(build_mesh(as_grid(rig_at(points), 4, 4), {corner}));
    expect_planar(points, faces);
    EXPECT_EQ(twice_area(points, faces), 18'000'000 - 1'000'000);
  }
}

TEST(MeshOfGrid, DoesNotDependOnSizePositionAndTilt) {
  const auto points = grid_points(6, 7);
  const CameraSet lost{3, 9, 10, 20, 41};
  const auto expected = corners(build_mesh(as_grid(rig_at(points), 6, 7), lost));
  for (const double pitch : {0x1p-20, 0x1p-30, 1.0, 0x1p40}) {
    for (const Vec3& place : {Vec3(0), Vec3(0x1p20, -0x1p20, 0x1p20)}) {
      if (place.x != 0 && pitch < 0x1p-25) continue;  // below the resolution of double at this position
      std::vector<Vec3> positions;
      for (const IntPoint p : points) positions.push_back(place + pitch / 1000 * Vec3(p.x, p.y, 0));
      EXPECT_EQ(corners(build_mesh(as_grid(rig_at(positions), 6, 7), lost)), expected) << pitch;
    }
  }
  const Pose tilted{{5, 6, 7}, glm::normalize(Quat(0.4, 0.5, -0.6, 0.1))};
  Rig rig = as_grid(rig_at(points), 6, 7);
  for (Camera& camera : rig.cameras) camera.pose = {tilted.world_from_camera(camera.pose.position), tilted.orientation};
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
  const auto thousand = grid_points(32, 32, 1000, 490);
  EXPECT_EQ(corners(build_mesh(rig_at(thousand))), delaunay(thousand));
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
  for (Camera& camera : rig.cameras)
    camera.pose = {tilted.world_from_camera(camera.pose.position * 0.1), tilted.orientation};
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
  for (const Triangle& t : corners(build_mesh(rig_at(positions))))
    expected.push_back(canonical_triangle({new_index[t[0]], new_index[t[1]], new_index[t[2]]}));
  std::sort(expected.begin(), expected.end());
  EXPECT_EQ(corners(build_mesh(rig_at(renumbered))), expected);
}

TEST(MeshOfDelaunay, UsesTheLowestOfCoincidentCameras) {
  const Rig rig = rig_at(std::vector<IntPoint>{{0, 0}, {9, 0}, {0, 9}, {9, 0}});
  EXPECT_THAT(corners(build_mesh(rig)), ElementsAre(Triangle{0, 1, 2}));
  EXPECT_THAT(corners(build_mesh(rig, {1})), ElementsAre(Triangle{0, 3, 2}));
}

// Every topology without a remaining triangle of positive area.
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

TEST(MeshWithoutTriangles, CollinearCamerasAreStrips) {
  const Vec3 direction = glm::normalize(Vec3(0.3, 0.7, 0.1));
  for (const double scale : {1e-6, 1.0, 1e6}) {
    for (const double distance : {0.0, 1e6}) {
      std::vector<Vec3> positions;
      for (const double at : {0.0, 0.31, 0.57, 0.58, 1.0, 1.31})
        positions.push_back(Vec3(distance, -distance, distance / 3) + scale * at * direction);
      const Rig rig = rig_at(positions);
      const std::vector<Triangle> strips{{0, 1, kNone}, {1, 2, kNone}, {2, 3, kNone}, {3, 4, kNone}, {4, 5, kNone}};
      EXPECT_EQ(corners(build_mesh(rig)), strips) << scale << " at " << distance;
      EXPECT_EQ(corners(build_mesh(as_grid(rig, 2, 3))), strips);
      EXPECT_EQ(corners(build_mesh(as_triangles(rig, {{0, 1, 2}, {3, 4, 5}}))), strips);
      EXPECT_THAT(corners(build_mesh(rig, {1, 2, 5})), ElementsAre(Triangle{0, 3, kNone}, Triangle{3, 4, kNone}));
    }
  }
}

TEST(MeshWithoutTriangles, RemainingRowOrDiagonalIsStrips) {
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

TEST(Mesh, KeepsTrianglesWithoutArea) {
  const Rig rig = as_triangles(rig_at(std::vector<IntPoint>{{0, 0}, {1, 0}, {2, 0}, {0, 1}}), {{0, 1, 2}, {0, 1, 3}});
  EXPECT_THAT(corners(build_mesh(rig)), ElementsAre(Triangle{0, 1, 2}, Triangle{0, 1, 3}));
}

TEST(Mesh, ErrorsNameTheProblem) {
  const Rig square = rig_at(grid_points(2, 2));
  for (const Rig& rig : {square, as_grid(square, 2, 2), as_triangles(square, grid_faces(2, 2))}) {
    EXPECT_ERROR(build_mesh(rig, {4}), "camera 4");
    EXPECT_ERROR(build_mesh(rig, {1, UINT32_MAX}), "camera 4294967295");
  }
  EXPECT_ERROR(build_mesh(as_triangles(square, {{0, 1, 2}, {0, 1, 9}})), "topology.triangles[1][2]");
  EXPECT_ERROR(build_mesh(as_grid(square, 2, 3)), "2 rows", "3 columns");
  EXPECT_ERROR(build_mesh(as_grid(square, -2, -2)), "-2 rows");
  Rig nan = square;
  nan.cameras[2].pose.position.z = std::numeric_limits<double>::quiet_NaN();
  EXPECT_ERROR(build_mesh(nan), "cameras[2].position");
}

Mesh strips(const Rig& rig, std::vector<CameraIndex> in_service = {}) {
  std::vector<Vec3> positions;
  for (CameraIndex i = 0; i < rig.cameras.size(); ++i) positions.push_back(rig.cameras[i].pose.position);
  if (in_service.empty()) {
    for (CameraIndex i = 0; i < rig.cameras.size(); ++i) in_service.push_back(i);
  }
  return {make_strips(rig, in_service, normalised_centres(positions))};
}

TEST(Strips, OfOneAndTwoCameras) {
  EXPECT_THAT(corners(strips(rig_at(std::vector<Vec3>{{3, 4, 5}}))), ElementsAre(Triangle{0, kNone, kNone}));
  const Mesh mesh = strips(rig_at(std::vector<Vec3>{{3, 4, 5}, {4, 4, 5}}));
  ASSERT_THAT(corners(mesh), ElementsAre(Triangle{0, 1, kNone}));
  EXPECT_NEAR(glm::length(mesh.faces[0].extent - Vec3(0, 1, 0)), 0, 1e-15);  // forward x line
}

TEST(Strips, StartAtTheEndWithTheLowerIndex) {
  const Vec3 direction = glm::normalize(Vec3(3, 1, -0.5));
  std::vector<Vec3> positions;
  for (const double at : {0.3, 0.9, 0.1, 0.5, 0.7}) positions.push_back(Vec3(1e6, 0, -1e6) + at * direction);
  const Mesh mesh = strips(rig_at(positions));
  EXPECT_THAT(corners(mesh),
              ElementsAre(Triangle{1, 4, kNone}, Triangle{4, 3, kNone}, Triangle{3, 0, kNone}, Triangle{0, 2, kNone}));
  for (const MeshFace& face : mesh.faces) {
    EXPECT_EQ(face.extent, mesh.faces[0].extent);
    EXPECT_NEAR(glm::dot(face.extent, direction), 0, 1e-9);
    EXPECT_NEAR(glm::dot(face.extent, Vec3(0, 0, 1)), 0, 1e-15);
    EXPECT_NEAR(glm::length(face.extent), 1, 1e-15);
  }
  EXPECT_THAT(corners(strips(rig_at(positions), {0, 1, 4})), ElementsAre(Triangle{0, 4, kNone}, Triangle{4, 1, kNone}));
}

TEST(Strips, UseTheLowestOfCoincidentCameras) {
  EXPECT_THAT(corners(strips(rig_at(std::vector<Vec3>{{1, 0, 0}, {0, 0, 0}, {0, 0, 0}, {1, 0, 0}}))),
              ElementsAre(Triangle{0, 1, kNone}));
  EXPECT_THAT(corners(strips(rig_at(std::vector<Vec3>(3, Vec3(7, 7, 7))))), ElementsAre(Triangle{0, kNone, kNone}));
}

TEST(Strips, HaveAnExtentIfCamerasLookAlongTheLineOrAxesCancel) {
  const Mesh along = strips(rig_at(std::vector<Vec3>{{0, 0, 0}, {0, 0, 1}, {0, 0, 2}}));
  ASSERT_EQ(along.faces.size(), 2u);
  EXPECT_NEAR(glm::length(along.faces[0].extent - Vec3(0, 1, 0)), 0, 1e-15) << "downwards";
  Rig rig = rig_at(std::vector<Vec3>{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}});
  const Quat turns[4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};  // axes cancel
  for (int i = 0; i < 4; ++i) rig.cameras[i].pose.orientation = turns[i];
  const Mesh mesh = strips(rig);
  ASSERT_EQ(mesh.faces.size(), 3u);
  EXPECT_NEAR(glm::length(mesh.faces[0].extent), 1, 1e-15);
  EXPECT_NEAR(mesh.faces[0].extent.x, 0, 1e-15);
}

Rig without_topology(Rig rig) {
  rig.topology = {};
  return rig;
}

Rig inward(int rows, int columns) { return make_cylinder_rig({rows, columns, 0.3, 1.5, true, 60}); }

Rig dome(int cameras, double least_height) {
  Rig rig = make_grid_rig({1, cameras, 1, 60});
  rig.topology = {};
  std::mt19937 random(3);
  std::uniform_real_distribution<double> number(0, 1);
  for (Camera& camera : rig.cameras) {
    const double up = least_height + (1 - least_height) * number(random), turn = 2 * M_PI * number(random);
    const double across = std::sqrt(1 - up * up);
    const Vec3 at(across * std::cos(turn), -up, across * std::sin(turn));
    camera.pose = look_at(2.0 * at, Vec3(0), Vec3(0, 1, 0));
  }
  return rig;
}

TEST(MeshFit, RingGetsTrianglesAroundIt) {
  for (const bool inwards : {true, false}) {
    const Rig ring = make_cylinder_rig({2, 12, 0.3, 1.5, inwards, 60});
    Rig found = without_topology(ring);
    EXPECT_LT(share_facing_cameras(found, build_mesh(found)), 0.5) << "Delaunay triangulates across the ring";
    EXPECT_THAT(fit_topology(found), ElementsAre(HasSubstr(inwards ? "look at" : "look away")));
    ASSERT_EQ(found.topology.type, Topology::Type::kTriangles);
    EXPECT_EQ(found.topology.triangles.size(), ring.topology.triangles.size()) << "none at the open ends";
    EXPECT_EQ(share_facing_cameras(found, build_mesh(found)), 1);
    for (const auto& t : found.topology.triangles)
      for (int k = 0; k < 3; k++)
        EXPECT_LT(glm::length(found.cameras[t[k]].pose.position - found.cameras[t[(k + 1) % 3]].pose.position), 1);
  }
}

TEST(MeshFit, DomeIsClosed) {
  // A cap is flat enough for a plane; a full dome is not.
  Rig cap = dome(60, 0.7);
  EXPECT_TRUE(fit_topology(cap).empty());
  EXPECT_EQ(cap.topology.type, Topology::Type::kDelaunay);
  Rig sphere = dome(200, -1);
  ASSERT_EQ(fit_topology(sphere).size(), 1u);
  EXPECT_EQ(share_facing_cameras(sphere, build_mesh(sphere)), 1);
  EXPECT_EQ(sphere.topology.triangles.size(), 2 * 200u - 4) << "Euler: a closed mesh";
}

// Two shots from nearly the same place, for example in colour and infrared. The triangles between the cameras of a pair
// are steep but small.
TEST(MeshFit, PairsAtDifferentDepthsStayFlat) {
  const Rig grid = make_grid_rig({6, 6, 1.07, 60});
  Rig pairs = without_topology(grid);
  std::mt19937 random(11);
  std::uniform_real_distribution<double> degrees(-1, 1), offset(-0.005, 0.005);
  for (Camera camera : grid.cameras) {
    camera.id += 1000;
    camera.name += "_b";
    camera.pose.position += Vec3(offset(random), offset(random), 0.02);
    pairs.cameras.push_back(camera);
  }
  for (Camera& camera : pairs.cameras)
    camera.pose.orientation = quat_from_euler({degrees(random), degrees(random), 0}) * camera.pose.orientation;
  EXPECT_TRUE(fit_topology(pairs).empty());
  EXPECT_EQ(pairs.topology.type, Topology::Type::kDelaunay);
}

TEST(MeshFit, RowStaysARow) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> jitter(-0.002, 0.002);
  Rig arc = make_arc_rig({9, 0.2, 1, 60}), line = make_grid_rig({1, 9, 0.2, 60});
  for (Rig* rig : {&arc, &line}) {
    rig->topology = {};
    for (Camera& camera : rig->cameras) camera.pose.position.y += jitter(random);
    ASSERT_EQ(fit_topology(*rig).size(), 1u);
    const Mesh mesh = build_mesh(*rig);
    ASSERT_EQ(mesh.faces.size(), 8u);
    for (const MeshFace& face : mesh.faces) EXPECT_EQ(face.corners(), 2);
  }
}

TEST(MeshFit, SuitableMeshIsUnchanged) {
  Rig grid = without_topology(make_grid_rig({4, 5, 0.1, 60}));
  EXPECT_TRUE(fit_topology(grid).empty());
  EXPECT_EQ(grid.topology.type, Topology::Type::kDelaunay);
  Rig cylinder = inward(2, 12);
  const size_t triangles = cylinder.topology.triangles.size();
  EXPECT_TRUE(fit_topology(cylinder).empty()) << "already has a topology";
  EXPECT_EQ(cylinder.topology.triangles.size(), triangles);
  for (int cameras : {1, 2}) {
    Rig few = without_topology(make_grid_rig({1, cameras, 0.1, 60}));
    EXPECT_TRUE(fit_topology(few).empty());
  }
}

TEST(MeshFit, NotesAnUnsuitableMesh) {
  Rig ring = inward(2, 12);
  ring.cameras.resize(12);  // the upper row
  ring.topology = {};
  EXPECT_THAT(fit_topology(ring), ElementsAre(HasSubstr("two rows")));
}

TEST(MeshFit, AcceptsExtremePositions) {
  Rig far = without_topology(make_grid_rig({2, 3, 0.1, 60}));
  for (size_t i = 0; i < far.cameras.size(); i++) far.cameras[i].pose.position *= i % 2 ? 1e300 : 1e-300;
  fit_topology(far);
  Rig one_place = without_topology(make_grid_rig({2, 3, 0.1, 60}));
  for (Camera& camera : one_place.cameras) camera.pose.position = Vec3(1, 2, 3);
  EXPECT_TRUE(fit_topology(one_place).empty());
}

TEST(GridFault, NamesCamerasInTheWrongOrder) {
  Rig rig = make_grid_rig({4, 4, 0.1, 60});
  EXPECT_FALSE(find_grid_fault(rig));
  EXPECT_FALSE(find_grid_fault(make_grid_rig({1, 5, 0.1, 60})));
  EXPECT_FALSE(find_grid_fault(without_topology(rig)));
  Rig turned = rig;  // column by column: still a grid
  for (int row = 0; row < 4; row++)
    for (int column = 0; column < 4; column++)
      turned.cameras[row * 4 + column].pose = rig.cameras[column * 4 + row].pose;
  EXPECT_FALSE(find_grid_fault(turned));

  std::swap(rig.cameras[5].pose, rig.cameras[10].pose);
  const auto fault = find_grid_fault(rig).value();
  EXPECT_EQ(fault.triangles, 18u);
  EXPECT_GT(fault.folded, 0u);
  EXPECT_THAT(fault.text, HasSubstr("cam_0"));

  Rig wrong_shape = make_grid_rig({2, 8, 0.1, 60});
  wrong_shape.topology.rows = wrong_shape.topology.columns = 4;
  EXPECT_TRUE(find_grid_fault(wrong_shape));
  Rig line = make_grid_rig({1, 4, 0.1, 60});
  line.topology.rows = line.topology.columns = 2;
  EXPECT_TRUE(find_grid_fault(line));
}

}  // namespace
}  // namespace lf
