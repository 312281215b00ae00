// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/view_warp.h"

#include <gtest/gtest.h>

#include <cmath>

#include "scene/scene.h"
#include "support/expect_error.h"

namespace lf {
namespace {

class ViewWarpTest : public testing::Test {
 protected:
  ViewWarpTest() : rig_(scene_rig(3, 3, 64, 48)) {
    view_.width = 60;
    view_.height = 40;
    view_.lens = Lens::from_fov_y(30, 60, 40);
    view_.pose.position = Vec3(0.01, 0.02, -0.1);
    view_.focus.plane = focal_plane_at(view_.pose, kSceneMiddle);
  }
  ViewWarp warp() const { return view_warp(rig_, ViewPlan(rig_, build_mesh(rig_), view_)); }

  Rig rig_;
  View view_;
};

TEST_F(ViewWarpTest, MakesThePlanItWasMadeFrom) {
  const ViewPlan plan(rig_, build_mesh(rig_), view_), told(warp(), 9);
  Rig places_unknown = rig_;
  for (Camera& camera : places_unknown.cameras) camera.pose = {};
  EXPECT_FALSE(plan.contributors().empty());
  EXPECT_EQ(told.contributors(), plan.contributors());
  EXPECT_EQ(view_warp(places_unknown, told), warp()) << "and once more, by somebody who knows no places";
}

TEST_F(ViewWarpTest, WherePlaneAndEyeMeetThereIsNothingToTell) {
  view_.focus.plane = focal_plane_at(view_.pose, 0);
  EXPECT_TRUE(warp().faces.empty());
  EXPECT_TRUE(ViewPlan(warp(), 9).contributors().empty());
}

TEST_F(ViewWarpTest, IsOfOneRig) { EXPECT_ERROR(ViewPlan(warp(), 5), "is not one of the 5 of the rig"); }

TEST_F(ViewWarpTest, CornersAndCamerasBelongTogether) {
  EXPECT_NO_THROW(validate(warp()));
  ViewWarp bad = warp();
  bad.cameras.pop_back();
  EXPECT_ERROR(validate(bad), "cameras: must be the triangles' corners");
  bad = warp();
  bad.faces[1].camera[2] = bad.faces[1].camera[0];
  EXPECT_ERROR(validate(bad), "triangles[1].corners: must be one, two or three different cameras");
  bad = warp();
  bad.faces[0].rect.x1 = 61;
  EXPECT_ERROR(validate(bad), "triangles[0].rectangle: is not inside the view");
  bad = warp();
  bad.cameras[2].camera_from_ray[1][1] = NAN;
  EXPECT_ERROR(validate(bad), "cameras[2].matrix: must be finite numbers");
}

}  // namespace
}  // namespace lf
