// SPDX-License-Identifier: LGPL-2.1-or-later
#include "geometry/pose.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

void expect_near(const Vec3& a, const Vec3& b, double tolerance = 1e-14) {
  EXPECT_LE(glm::length(a - b), tolerance)
      << a.x << " " << a.y << " " << a.z << " is not " << b.x << " " << b.y << " " << b.z;
}

TEST(Pose, AxesAreRightDownForward) {
  const Pose identity;
  EXPECT_EQ(identity.right(), Vec3(1, 0, 0));
  EXPECT_EQ(identity.down(), Vec3(0, 1, 0));
  EXPECT_EQ(identity.forward(), Vec3(0, 0, 1));

  // A quarter turn about y (down) turns the view from forward to the right.
  const Pose turned{{1, 2, 3}, Quat(std::sqrt(0.5), 0, std::sqrt(0.5), 0)};
  expect_near(turned.forward(), {1, 0, 0});
  expect_near(turned.right(), {0, 0, -1});
  expect_near(turned.world_from_camera({0, 0, 5}), {6, 2, 3});
  expect_near(turned.camera_from_world({6, 2, 3}), {0, 0, 5});
}

TEST(Pose, WorldAndCameraAreInverse) {
  const Pose pose{{1e6, -2e6, 3}, glm::normalize(Quat(0.3, -0.5, 0.7, 0.1))};
  expect_near(pose.camera_from_world(pose.world_from_camera({0.1, 0.2, 0.3})), {0.1, 0.2, 0.3}, 1e-9);
  EXPECT_EQ(pose.camera_from_world(pose.position), Vec3(0, 0, 0));
}

TEST(LookAt, LooksAtTheTargetWithDownDown) {
  const Pose pose = look_at({1, 2, 3}, {4, -5, 9}, {0, 1, 0});
  EXPECT_EQ(pose.position, Vec3(1, 2, 3));
  EXPECT_NEAR(glm::length(pose.orientation), 1, 1e-15);
  expect_near(pose.forward(), glm::normalize(Vec3(3, -7, 6)));
  EXPECT_NEAR(pose.right().y, 0, 1e-15);
  EXPECT_GT(pose.down().y, 0);
  EXPECT_NEAR(glm::determinant(pose.rotation()), 1, 1e-14);
  expect_near(look_at({0, 0, 0}, {0, 0, 1}, {0, 1, 0}).forward(), {0, 0, 1});
  expect_near(look_at({0, 0, 0}, {0, 0, -1}, {0, 1, 0}).forward(), {0, 0, -1});
}

TEST(Plane, HoldsItsPoint) {
  const Plane plane = plane_through({1, 2, 3}, {0, 0.6, 0.8});
  EXPECT_NEAR(plane.signed_distance({1, 2, 3}), 0, 1e-15);
  EXPECT_NEAR(plane.signed_distance({7, 2.6, 3.8}), 1, 1e-15);
}

}  // namespace
}  // namespace lf
