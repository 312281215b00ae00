// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/detail.h"

#include <gtest/gtest.h>

#include "geometry/pose.h"

namespace lf {
namespace {

class DetailTest : public testing::Test {
 protected:
  DetailTest() {
    camera_.width = 320;
    camera_.height = 240;
    camera_.lens = Lens(LensModel::kRadial, {400, 159.5, 119.5, -0.1, 0.02});
    camera_.pose.position = {3, -2, 1};
    camera_.pose.orientation = quat_from_euler({20, -5, 3});
    view_ = {camera_.width, camera_.height, camera_.lens, camera_.pose, {}};
    view_.focus.plane = focal_plane_at(view_.pose, 2);
  }
  Camera camera_;
  View view_;
};

TEST_F(DetailTest, TheCamerasOwnViewIsItsPixels) {
  EXPECT_TRUE(is_pixel_for_pixel(view_, camera_));
  EXPECT_FALSE(shows_detail(view_, camera_));
}

TEST_F(DetailTest, SoIsAPartOfIt) {
  view_.width = 100;
  view_.height = 80;
  view_.lens = Lens(LensModel::kRadial, {400, 149.5, 89.5, -0.1, 0.02});
  EXPECT_TRUE(is_pixel_for_pixel(view_, camera_));
  view_.lens = Lens(LensModel::kRadial, {400, 149.2, 89.5, -0.1, 0.02});
  EXPECT_FALSE(is_pixel_for_pixel(view_, camera_)) << "between its pixels";
}

TEST_F(DetailTest, AnyOtherViewIsNot) {
  const auto expect_detail = [this](const char* what, const auto& change) {
    View other = view_;
    change(other);
    EXPECT_TRUE(shows_detail(other, camera_)) << what;
  };
  expect_detail("beside", [](View& view) { view.pose.position.x += 0.001; });
  expect_detail("turned", [](View& view) { view.pose.orientation = quat_from_euler({20.02, -5, 3}); });
  expect_detail("other distortion", [](View& view) { view.lens = Lens::pinhole(400, 159.5, 119.5); });
  expect_detail("zoomed", [](View& view) { view.lens = Lens(LensModel::kRadial, {402, 159.5, 119.5, -0.1, 0.02}); });
  expect_detail("twice as large", [](View& view) {
    view.lens = Lens(LensModel::kRadial, {800, 319, 239, -0.1, 0.02});
    view.width = 639;
    view.height = 479;
  });
}

TEST_F(DetailTest, CoarseViewsDoNotShowIt) {
  view_.pose.position.x += 0.1;
  view_.lens = Lens::pinhole(301, 159.5, 119.5);
  EXPECT_TRUE(shows_detail(view_, camera_));
  view_.lens = Lens::pinhole(299, 159.5, 119.5);
  EXPECT_FALSE(shows_detail(view_, camera_));
}

}  // namespace
}  // namespace lf
