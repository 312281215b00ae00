// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/array_plane.h"

#include <gtest/gtest.h>

#include <cmath>

#include "scene/scene.h"

namespace lf {
namespace {

TEST(ArrayPlane, GoesThroughTheMiddleAlongTheMeanAxis) {
  Rig rig = scene_rig(3, 5);
  for (Camera& camera : rig.cameras) camera.pose.position += Vec3(1e6, 2e6, -3e6);
  const Plane plane = array_plane(rig);
  EXPECT_NEAR(glm::length(plane.normal - Vec3(0, 0, 1)), 0, 1e-12);
  EXPECT_NEAR(plane.signed_distance({1e6, 2e6, -3e6}), 0, 1e-9);
  EXPECT_NEAR(plane.signed_distance({1e6 + 7, 2e6, -3e6 + 2}), 2, 1e-9) << "distances grow forwards";
}

TEST(ArrayPlane, OfOppositeCamerasIsTheFirstOnes) {
  Rig rig = scene_rig(1, 2);
  rig.cameras[1].pose.orientation = glm::angleAxis(M_PI, Vec3(0, 1, 0));
  EXPECT_NEAR(array_plane(rig).normal.z, 1, 1e-12);
}

}  // namespace
}  // namespace lf
