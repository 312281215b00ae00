// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/visible_share.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace lf
