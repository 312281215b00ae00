// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/plane_map.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

TEST(PlaneMap, IsTheViewersPlane) {
  View view;
  view.width = 64;
  view.height = 48;
  view.lens = Lens::from_fov_y(40, 64, 48);
  view.pose = look_at({0.2, -0.1, 0.3}, {0, 0, 3}, {0, 1, 0});
  view.focus.plane = plane_through({0, 0, 2.5}, glm::normalize(Vec3(0.2, 0.1, -1)));  // oblique
  const Plane from{{0, 0, 1}, 0};
  const FocalMap map = plane_map(view, from, 1, 0.2);
  for (int j = 0; j < map.rows; j++)
    for (int i = 0; i < map.columns; i++) {
      const Vec3 d = view.pose.rotation() * Vec3(*view.lens.unproject({4 * i + 1.5, 4 * j + 1.5}), 1);
      const double t = -view.focus.plane.signed_distance(view.pose.position) / glm::dot(view.focus.plane.normal, d);
      const double z = (view.pose.position + t * d).z;
      EXPECT_NEAR(map.inverse_of(map.levels[j * map.columns + i]), 1 / z, 0.8 / 255 / 2 + 1e-12);
    }
}

TEST(PlaneMap, BehindTheEyeIsFarAway) {
  View view;
  view.width = view.height = 16;
  view.lens = Lens::from_fov_y(40, 16, 16);
  view.focus.plane = plane_through({0, 0, -2}, {0, 0, 1});
  EXPECT_EQ(plane_inverse(view, {{0, 0, 1}, 0}, {0, 0, 1}), 0);
  EXPECT_EQ(plane_map(view, {{0, 0, 1}, 0}, 1, 0.2).levels, std::vector<uint8_t>(16, 0));
}

}  // namespace
}  // namespace lf
