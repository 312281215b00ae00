// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/visible_share.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "geometry/pose.h"
#include "render/contribution_map.h"
#include "rig/grid_rig.h"

namespace lf {
namespace {

constexpr double kAspect = 4.0 / 3;

Rig array(int rows, int columns) {
  return make_grid_rig({.rows = rows, .columns = columns, .pitch = 0.1, .fov_y_deg = 40, .width = 320, .height = 240});
}
Viewpoint moved(const Rig& rig, const Vec3& by) {
  Viewpoint v = default_viewpoint(rig);
  v.pose.position += by;
  return v;
}

TEST(VisibleShare, IsOneInsideOfTheArrayAndZeroBesideIt) {
  const Rig rig = array(4, 6);
  const VisibleShare share(rig);
  EXPECT_NEAR(share(moved(rig, {0.02, 0.03, 0}), kAspect), 1, 1e-6);
  EXPECT_NEAR(share(moved(rig, {0.24, 0.14, 0}), kAspect), 1, 1e-6);
  EXPECT_EQ(share(moved(rig, {0.26, 0, 0}), kAspect), 0);
  EXPECT_EQ(share(moved(rig, {0, -0.16, 0}), kAspect), 0);
}

TEST(VisibleShare, FromBehindTheArrayIsAWindow) {
  const Rig rig = array(4, 6);
  const VisibleShare share(rig);
  // 1 m behind: 0.5 m of the 2 tan(20) m x 4/3 that the view spans there, times 0.3 m of 2 tan(20) m.
  const double height = 2 * std::tan(20 * M_PI / 180);
  EXPECT_NEAR(share(moved(rig, {0, 0, -1}), kAspect), 0.5 / (height * kAspect) * 0.3 / height, 0.05);
  EXPECT_LT(share(moved(rig, {0, 0, -3}), kAspect), share(moved(rig, {0, 0, -1}), kAspect));
}

TEST(VisibleShare, CountsWhatNoCameraSees) {
  const Rig rig = array(4, 6);
  const VisibleShare share(rig);
  Viewpoint wide = default_viewpoint(rig);
  wide.fov_y_deg = 2 * std::atan(2 * std::tan(20 * M_PI / 180)) * 180 / M_PI;  // twice the cameras'
  EXPECT_NEAR(share(wide, kAspect), 0.25, 0.06);
  EXPECT_NEAR(share(default_viewpoint(rig), 2 * kAspect), 0.5, 0.06);
}

TEST(VisibleShare, DoesNotDependOnTheFocus) {
  const Rig rig = array(4, 6);
  const VisibleShare share(rig);
  Viewpoint near = moved(rig, {0.1, 0.05, 0.1});
  near.focus_distance = 0.01;
  EXPECT_EQ(share(near, kAspect), share(moved(rig, {0.1, 0.05, 0.1}), kAspect));
}

TEST(VisibleShare, OneCameraAndARow) {
  const Rig one = array(1, 1);
  Viewpoint turned = default_viewpoint(one);
  EXPECT_NEAR(VisibleShare(one)(turned, kAspect), 1, 1e-6);
  turned.pose.orientation = glm::angleAxis(M_PI / 2, Vec3(0, 1, 0));
  EXPECT_EQ(VisibleShare(one)(turned, kAspect), 0);
  const Rig row = array(1, 5);
  EXPECT_NEAR(VisibleShare(row)(moved(row, {0.1, 0.05, 0}), kAspect), 1, 1e-6);
  EXPECT_EQ(VisibleShare(row)(moved(row, {0.3, 0, 0}), kAspect), 0);
}

// Of all shapes, as much as the cameras have, and not a dark pixel.
TEST(VisibleShare, HomeFitsTheShapeOfTheView) {
  for (const double error : {0.0, 2.0}) {
    Rig rig = array(4, 6);
    std::mt19937 random(3);
    std::uniform_real_distribution<double> degrees(-error, error);
    for (Camera& camera : rig.cameras)
      camera.pose.orientation = quat_from_euler({degrees(random), degrees(random), degrees(random)});
    const Mesh mesh = build_mesh(rig);
    const VisibleShare share(rig);
    for (const double aspect : {0.5, 0.75, 1.0, kAspect, 16.0 / 9, 21.0 / 9}) {
      const Viewpoint home = share.home(aspect);
      const double high = std::tan(home.fov_y_deg * M_PI / 360), camera = std::tan(20 * M_PI / 180);
      if (error == 0) {
        EXPECT_NEAR(std::max(high, high * aspect / kAspect), camera, 0.06 * camera) << aspect;
      }
      EXPECT_GT(std::max(high, high * aspect / kAspect), 0.85 * camera) << aspect;
      const int height = 240, width = static_cast<int>(std::lround(height * aspect));
      const ViewPlan plan(rig, mesh, make_view(home, width, height));
      const std::vector<float> seen = view_coverage(rig, plan, OwnerMap(plan, {0, 0, width, height}));
      // The rasters' own pixels are smaller than those of the one that home was found with.
      EXPECT_EQ(std::ranges::count_if(seen, [](float s) { return s <= 0; }), 0) << aspect;
      EXPECT_LT(glm::length(home.pose.position - default_viewpoint(rig).pose.position), 0.06) << "of a pitch of 0.1 m";
    }
  }
}

// Where home looks into the dark nothing is gained by a narrow view.
TEST(VisibleShare, HomeOfARingIsTheDefault) {
  Rig ring = array(1, 4);
  for (size_t i = 0; i < 4; i++) {
    ring.cameras[i].pose.orientation = glm::angleAxis(i * M_PI / 2, Vec3(0, 1, 0));
    ring.cameras[i].pose.position = ring.cameras[i].pose.forward();
  }
  EXPECT_EQ(VisibleShare(ring).home(kAspect, 3).fov_y_deg, default_viewpoint(ring, 3).fov_y_deg);
  EXPECT_EQ(VisibleShare(ring).home(kAspect, 3).focus_distance, 3);
}

}  // namespace
}  // namespace lf
