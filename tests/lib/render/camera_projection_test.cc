// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/camera_projection.h"

#include <gtest/gtest.h>

#include "scene/scene.h"

namespace lf {
namespace {

View view_at(const Vec3& eye, double focus) {
  View view;
  view.width = 40;
  view.height = 30;
  view.lens = Lens::from_fov_y(40, 40, 30);
  view.pose = look_at(eye, Vec3(0.1, 0, 3), Vec3(0, 1, 0));
  view.focus.plane = focal_plane_at(view.pose, focus);
  return view;
}

TEST(CameraProjection, IsTheFocalPointSeenByTheCamera) {
  Rig rig = scene_rig(2, 2, 64, 48);
  rig.cameras[2].lens = Lens(LensModel::kRadial, {80, 31.5, 23.5, -0.1, 0.02});
  const Mesh mesh = build_mesh(rig);
  for (const double focus : {0.5, 2.0, 100.0}) {
    const View view = view_at({0.03, -0.02, -0.1}, focus);
    const ViewPlan plan(rig, mesh, view);
    for (CameraIndex i = 0; i < rig.cameras.size(); i++) {
      const Camera& camera = rig.cameras[i];
      const CameraProjection projection(plan, i, camera);
      for (int y = 0; y < view.height; y += 7)
        for (int x = 0; x < view.width; x += 7) {
          const Vec3 d(*view.lens.unproject(Vec2(x, y)), 1);
          const Vec3 point = view.pose.world_from_camera(d * focus);  // the plane faces the view
          const std::optional<Vec2> expected = camera.lens.project(camera.pose.camera_from_world(point));
          Vec2 pixel;
          const bool inside = expected && expected->x >= -0.5 && expected->x <= camera.width - 0.5 &&
                              expected->y >= -0.5 && expected->y <= camera.height - 0.5;
          ASSERT_EQ(projection.project(Vec2(d), 0, pixel), inside);
          if (!inside) continue;
          EXPECT_NEAR(pixel.x, expected->x, 1e-9);
          EXPECT_NEAR(pixel.y, expected->y, 1e-9);
        }
    }
  }
}

TEST(CameraProjection, BehindTheCameraIsLost) {
  Rig rig = scene_rig(2, 2, 64, 48);
  const View view = view_at({0, 0, -5}, 2);  // the focal plane lies 3 m behind the cameras
  const ViewPlan plan(rig, build_mesh(rig), view);
  Vec2 pixel;
  EXPECT_FALSE(CameraProjection(plan, 0, rig.cameras[0]).project(Vec2(0, 0), 0, pixel));
}

TEST(CameraProjection, TheImageEndsHalfAPixelBeyondItsOuterCentres) {
  Rig rig = scene_rig(2, 2, 64, 48);
  View view;  // camera 0 itself
  view.width = 64;
  view.height = 48;
  view.lens = rig.cameras[0].lens;
  view.pose = rig.cameras[0].pose;
  view.focus.plane = focal_plane_at(view.pose, 2);
  const ViewPlan plan(rig, build_mesh(rig), view);
  const CameraProjection projection(plan, 0, rig.cameras[0]);
  const Lens& lens = view.lens;
  const auto sees = [&](double x, double y) {
    Vec2 pixel;
    return projection.project(Vec2((x - lens.cx()) / lens.fx(), (y - lens.cy()) / lens.fy()), 0, pixel);
  };
  EXPECT_TRUE(sees(-0.499, 0));
  EXPECT_FALSE(sees(-0.501, 0));
  EXPECT_TRUE(sees(63.499, 47.499));
  EXPECT_FALSE(sees(63.501, 0));
  EXPECT_FALSE(sees(0, 47.501));
}

}  // namespace
}  // namespace lf
