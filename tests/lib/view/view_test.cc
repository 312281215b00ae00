// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/view.h"

#include <functional>

#include <gtest/gtest.h>

#include "rig/rig.h"
#include "support/expect_error.h"

namespace lf {
namespace {

View good_view() {
  View view;
  view.width = 320;
  view.height = 240;
  view.lens = Lens::from_fov_y(50, 320, 240);
  view.focus.plane = focal_plane_at(view.pose, 3);
  return view;
}

TEST(View, ValidatesSizesFromTinyToLargest) {
  View view = good_view();
  EXPECT_NO_THROW(validate(view));
  for (const int size : {1, 8192, kMaxImageSize}) {
    view.width = view.height = size;
    EXPECT_NO_THROW(validate(view));
  }
}

TEST(View, EyesSideBySideFocusOnOnePlane) {
  View view = good_view();
  view.pose = {{1, 2, 3}, glm::angleAxis(0.5, glm::normalize(Vec3(1, 2, 3)))};
  view.focus.plane = focal_plane_at(view.pose, 3);
  const View right = seen_beside(view, 0.06);
  EXPECT_LT(glm::length(view.pose.camera_from_world(right.pose.position) - Vec3(0.06, 0, 0)), 1e-15);
  EXPECT_EQ(right.pose.orientation, view.pose.orientation);
  EXPECT_EQ(right.focus, view.focus);
  EXPECT_EQ(right.lens, view.lens);
  EXPECT_EQ(seen_beside(view, 0), view);
}

TEST(View, RefusesByName) {
  const double nan = std::nan("");
  const std::pair<const char*, std::function<void(View&)>> cases[] = {
      {"width: must be 1 to", [](View& v) { v.width = 0; }},
      {"width: must be 1 to", [](View& v) { v.width = kMaxImageSize + 1; }},
      {"height: must be 1 to", [](View& v) { v.height = -1; }},
      {"position: ", [&](View& v) { v.pose.position.y = nan; }},
      {"position: ", [&](View& v) { v.pose.position.z = INFINITY; }},
      {"orientation: ", [&](View& v) { v.pose.orientation.x = nan; }},
      {"orientation: ", [](View& v) { v.pose.orientation.w = 1.001; }},
      {"orientation: ", [](View& v) { v.pose.orientation = Quat(0, 0, 0, 0); }},
      {"focal_plane: ", [&](View& v) { v.focus.plane.normal.z = nan; }},
      {"focal_plane: ",
       [](View& v) {
         v.focus.plane.normal = {0, 0, 0.9};
       }},
      {"focal_plane: ", [&](View& v) { v.focus.plane.d = nan; }},
  };
  for (const auto& [message, spoil] : cases) {
    View view = good_view();
    spoil(view);
    EXPECT_ERROR(validate(view), message);
  }
}

TEST(FocalPlane, FacesTheViewAtItsDistance) {
  const Pose pose = look_at({1, 2, 3}, {4, 4, 9}, {0, 1, 0});
  const Plane plane = focal_plane_at(pose, 2.5);
  EXPECT_NEAR(plane.signed_distance(pose.position), 2.5, 1e-14);
  EXPECT_NEAR(plane.signed_distance(pose.world_from_camera({0.7, -3, 2.5})), 0, 1e-14);
}

}  // namespace
}  // namespace lf
