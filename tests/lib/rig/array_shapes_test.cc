// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/array_shapes.h"

#include <gtest/gtest.h>

#include "rig/mesh.h"
#include "rig/rig_json.h"
#include "support/expect_error.h"

namespace lf {
namespace {

double apart(const Rig& rig, size_t a, size_t b) {
  return glm::length(rig.cameras[a].pose.position - rig.cameras[b].pose.position);
}

TEST(ArcRig, StandsAroundItsCentreAndLooksAtIt) {
  const Rig rig = make_arc_rig({.cameras = 9, .pitch = 0.06, .radius = 1.5, .fov_y_deg = 50});
  ASSERT_EQ(rig.cameras.size(), 9u);
  const Vec3 centre(0, 0, 1.5);
  for (size_t i = 0; i < 9; i++) {
    const Pose& pose = rig.cameras[i].pose;
    EXPECT_NEAR(glm::length(pose.position - centre), 1.5, 1e-12);
    EXPECT_NEAR(glm::length(pose.forward() - (centre - pose.position) / 1.5), 0, 1e-12) << "looks at the centre";
    EXPECT_NEAR(glm::length(pose.down() - Vec3(0, 1, 0)), 0, 1e-12) << "upright";
    if (i == 0) continue;
    EXPECT_NEAR(apart(rig, i - 1, i), 0.06, 1e-12);
    EXPECT_GT(pose.position.x, rig.cameras[i - 1].pose.position.x) << "from the left";
  }
  EXPECT_NEAR(glm::length(rig.cameras[4].pose.position), 0, 1e-12);
  EXPECT_EQ(rig.cameras[3].name, "cam_03");
  EXPECT_EQ(build_mesh(rig).faces.size(), 8u) << "a strip between neighbours";
  EXPECT_EQ(parse_rig(rig_to_json(rig), "arc").hash(), rig.hash());
}

TEST(ArcRig, RefusesNonsense) {
  EXPECT_ERROR(make_arc_rig({.cameras = 4, .pitch = 0, .radius = 1, .fov_y_deg = 50}), "pitch: must be positive");
  EXPECT_ERROR(make_arc_rig({.cameras = 4, .pitch = 1, .radius = -1, .fov_y_deg = 50}), "radius: must be positive");
  EXPECT_ERROR(make_arc_rig({.cameras = 4, .pitch = 1, .radius = 1, .fov_y_deg = 50}), "half the circle");
  EXPECT_ERROR(make_arc_rig({.cameras = 2, .pitch = 3, .radius = 1, .fov_y_deg = 50}), "half the circle");
  EXPECT_ERROR(make_arc_rig({.cameras = 0, .pitch = 1, .radius = 1, .fov_y_deg = 50}), "columns: must be 1 to");
  EXPECT_ERROR(make_arc_rig({.cameras = 3, .pitch = 0.1, .radius = 1, .fov_y_deg = 0}), "fov_y: must be between");
}

TEST(RingRig, IsACircleThatLooksForward) {
  const Rig rig = make_ring_rig({.cameras = 8, .radius = 0.2, .fov_y_deg = 60});
  ASSERT_EQ(rig.cameras.size(), 8u);
  for (const Camera& camera : rig.cameras) {
    EXPECT_NEAR(glm::length(camera.pose.position), 0.2, 1e-12);
    EXPECT_NEAR(glm::length(camera.pose.forward() - Vec3(0, 0, 1)), 0, 1e-12);
  }
  EXPECT_NEAR(glm::length(rig.cameras[0].pose.position - Vec3(0, -0.2, 0)), 0, 1e-12) << "y is down";
  EXPECT_NEAR(glm::length(rig.cameras[2].pose.position - Vec3(0.2, 0, 0)), 0, 1e-12);
  EXPECT_EQ(build_mesh(rig).faces.size(), 6u) << "the triangles of an octagon";
  EXPECT_ERROR(make_ring_rig({.cameras = 2, .radius = 0.2, .fov_y_deg = 60}), "at least 3 cameras");
  EXPECT_ERROR(make_ring_rig({.cameras = 5, .radius = 0, .fov_y_deg = 60}), "radius: must be positive");
}

TEST(CylinderRig, StandsAroundItsAxisAndClosesItsMesh) {
  for (const bool inward : {true, false}) {
    const Rig rig =
        make_cylinder_rig({.rows = 3, .columns = 10, .pitch = 0.2, .radius = 1.5, .inward = inward, .fov_y_deg = 50});
    ASSERT_EQ(rig.cameras.size(), 30u);
    const Vec3 middle(0, 0, inward ? 1.5 : 0);
    for (size_t i = 0; i < 30; i++) {
      const Pose& pose = rig.cameras[i].pose;
      const Vec3 from_axis = pose.position - Vec3(middle.x, pose.position.y, middle.z);
      EXPECT_NEAR(glm::length(from_axis), 1.5, 1e-12);
      EXPECT_NEAR(pose.position.y, 0.2 * (static_cast<double>(i / 10) - 1), 1e-12);
      EXPECT_NEAR(glm::length(pose.forward() - (inward ? -1.0 : 1.0) * from_axis / 1.5), 0, 1e-12);
      EXPECT_NEAR(glm::length(pose.down() - Vec3(0, 1, 0)), 0, 1e-12) << "upright";
      const Pose& next = rig.cameras[i / 10 * 10 + (i + 1) % 10].pose;
      EXPECT_GT(pose.camera_from_world(next.position).x, 0) << "to the right";
    }
    EXPECT_NEAR(glm::length(rig.cameras[10].pose.forward() - Vec3(0, 0, 1)), 0, 1e-12);
    EXPECT_EQ(rig.cameras[23].name, "cam_02_03");
    const Mesh mesh = build_mesh(rig);
    EXPECT_EQ(mesh.faces.size(), 40u);
    std::vector<int> faces(30);
    for (const MeshFace& face : mesh.faces)
      for (const CameraIndex camera : face.camera) faces[camera]++;
    for (size_t i = 0; i < 30; i++) EXPECT_EQ(faces[i], i / 10 == 1 ? 6 : 3) << "the same all around";
    EXPECT_EQ(parse_rig(rig_to_json(rig), "cylinder").hash(), rig.hash());
  }
}

TEST(CylinderRig, RefusesNonsense) {
  const CylinderRigOptions good{.rows = 2, .columns = 3, .pitch = 0.1, .radius = 1, .fov_y_deg = 50};
  EXPECT_EQ(make_cylinder_rig(good).cameras.size(), 6u);
  CylinderRigOptions options = good;
  options.rows = 1;
  EXPECT_ERROR(make_cylinder_rig(options), "rows: around a cylinder at least 2");
  options = good;
  options.columns = 2;
  EXPECT_ERROR(make_cylinder_rig(options), "columns: around a cylinder at least 3");
  options = good;
  options.radius = 0;
  EXPECT_ERROR(make_cylinder_rig(options), "radius: must be positive");
  options = good;
  options.pitch = -1;
  EXPECT_ERROR(make_cylinder_rig(options), "pitch: must be positive");
}

}  // namespace
}  // namespace lf
