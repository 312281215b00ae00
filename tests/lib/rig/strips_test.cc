// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/mesh.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/mesh_rigs.h"

namespace lf {
namespace {

using test::corners;
using test::rig_at;
using testing::ElementsAre;

constexpr CameraIndex kNone = MeshFace::kNone;

Mesh strips(const Rig& rig, std::vector<CameraIndex> in_service = {}) {
  std::vector<Vec3> positions;
  for (CameraIndex i = 0; i < rig.cameras.size(); ++i) positions.push_back(rig.cameras[i].pose.position);
  if (in_service.empty()) {
    for (CameraIndex i = 0; i < rig.cameras.size(); ++i) in_service.push_back(i);
  }
  return {make_strips(rig, in_service, normalised_centres(positions))};
}

TEST(Strips, OneCameraIsAPoint) {
  const Mesh mesh = strips(rig_at(std::vector<Vec3>{{3, 4, 5}}));
  ASSERT_EQ(mesh.faces.size(), 1u);
  EXPECT_EQ(mesh.faces[0].corners(), 1);
  EXPECT_EQ(mesh.faces[0].camera[0], 0u);
}

TEST(Strips, TwoCamerasAreAStripAcrossTheirLine) {
  const Mesh mesh = strips(rig_at(std::vector<Vec3>{{3, 4, 5}, {4, 4, 5}}));
  ASSERT_EQ(mesh.faces.size(), 1u);
  EXPECT_EQ(mesh.faces[0].corners(), 2);
  EXPECT_THAT(corners(mesh), ElementsAre(Triangle{0, 1, kNone}));
  EXPECT_NEAR(glm::length(mesh.faces[0].extent - Vec3(0, 1, 0)), 0, 1e-15);  // forward x line
}

TEST(Strips, NeighboursAlongTheLineFromTheEndWithTheLowerIndex) {
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

TEST(Strips, OfCamerasAtOnePlaceTheLowestIndexCounts) {
  EXPECT_THAT(corners(strips(rig_at(std::vector<Vec3>{{1, 0, 0}, {0, 0, 0}, {0, 0, 0}, {1, 0, 0}}))),
              ElementsAre(Triangle{0, 1, kNone}));
  EXPECT_THAT(corners(strips(rig_at(std::vector<Vec3>(3, Vec3(7, 7, 7))))), ElementsAre(Triangle{0, kNone, kNone}));
}

TEST(Strips, CamerasThatLookAlongTheirLineExtendDownwards) {
  const Mesh mesh = strips(rig_at(std::vector<Vec3>{{0, 0, 0}, {0, 0, 1}, {0, 0, 2}}));
  ASSERT_EQ(mesh.faces.size(), 2u);
  EXPECT_NEAR(glm::length(mesh.faces[0].extent - Vec3(0, 1, 0)), 0, 1e-15);
}

TEST(Strips, CamerasThatLookEveryWayStillHaveAnExtent) {
  Rig rig = rig_at(std::vector<Vec3>{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}});
  const Quat turns[4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};  // axes cancel
  for (int i = 0; i < 4; ++i) rig.cameras[i].pose.orientation = turns[i];
  const Mesh mesh = strips(rig);
  ASSERT_EQ(mesh.faces.size(), 3u);
  EXPECT_NEAR(glm::length(mesh.faces[0].extent), 1, 1e-15);
  EXPECT_NEAR(mesh.faces[0].extent.x, 0, 1e-15);
}

}  // namespace
}  // namespace lf
