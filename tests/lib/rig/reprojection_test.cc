// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"

#include <limits>

#include <gtest/gtest.h>

namespace lf {
namespace {

Rig one_camera() {
  Rig rig;
  Camera camera;
  camera.width = 320;
  camera.height = 240;
  camera.lens = Lens(LensModel::kRadial, {400, 159.5, 119.5, -0.15, 0.03});
  camera.pose = {{1e6, -2, 3}, glm::normalize(Quat(0.9, 0.1, -0.2, 0.3))};
  rig.cameras.push_back(camera);
  return rig;
}

TEST(ReprojectionError, OfARigWithItselfIsNothing) {
  EXPECT_LE(max_reprojection_error(one_camera(), one_camera(), 1), 1e-11);
}

TEST(ReprojectionError, MeasuresEachKindOfDifferenceInPixels) {
  const Rig rig = one_camera();
  Rig other = rig;
  other.cameras[0].lens = Lens(LensModel::kRadial, {400, 159.5, 119.75, -0.15, 0.03});
  EXPECT_NEAR(max_reprojection_error(rig, other, 1), 0.25, 1e-9);

  other = rig;  // the corner moves by 0.5 % of its (distorted) radius of 200 px and a little
  other.cameras[0].lens = Lens(LensModel::kRadial, {402, 159.5, 119.5, -0.15, 0.03});
  EXPECT_NEAR(max_reprojection_error(rig, other, 1), 1, 1e-9);

  other = rig;  // 1 mm sideways at 2 m: 400 * 0.0005 px at the centre, less towards the corners of a barrel
  other.cameras[0].pose.position += 0.001 * rig.cameras[0].pose.right();
  EXPECT_NEAR(max_reprojection_error(rig, other, 2), 0.2, 1e-6);

  other = rig;  // half a turn: nothing is seen
  other.cameras[0].pose.orientation = rig.cameras[0].pose.orientation * Quat(0, 0, 1, 0);
  EXPECT_EQ(max_reprojection_error(rig, other, 1), std::numeric_limits<double>::infinity());
  EXPECT_EQ(max_reprojection_error(rig, Rig{}, 1), std::numeric_limits<double>::infinity());
}

}  // namespace
}  // namespace lf
