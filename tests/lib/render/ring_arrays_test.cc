// SPDX-License-Identifier: LGPL-2.1-or-later
// Arrays that go all around: a line of sight meets them twice, and still no pixel is counted twice.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "geometry/pose.h"
#include "lib/render/production.h"
#include "reference/renderer.h"
#include "rig/array_shapes.h"
#include "view/navigator.h"

namespace lf {
namespace ring_arrays_test {

constexpr int kWidth = 40, kHeight = 30;

struct Counted {
  int owned = 0, pixels = 0;
};

// Of each pixel the weights of all cameras add up to 1, or to 0 where none of the array's triangles is; each is what
// the rule in double precision gives it.
Counted count(const Rig& rig, const Viewpoint& viewpoint) {
  const Mesh mesh = build_mesh(rig);
  const View view = make_view(viewpoint, kWidth, kHeight);
  const test::Production production(rig, mesh, view);
  const auto own_weights = production.own_weights();
  const reference::Picture expected = reference::render(rig, mesh, view, {});
  Counted counted;
  for (int y = 0; y < kHeight; y++)
    for (int x = 0; x < kWidth; x++) {
      double sum = 0;
      for (const auto& own : own_weights) {
        const double weight = own.weight[static_cast<size_t>(y) * kWidth + x];
        if (expected.at(x, y).owner_margin > 1e-9) {
          EXPECT_NEAR(weight, expected.weight_of(x, y, own.camera), 1e-6) << x << ", " << y;
        }
        sum += weight;
      }
      counted.pixels++;
      counted.owned += sum > 0.5;
      EXPECT_NEAR(sum, sum > 0.5 ? 1 : 0, 1e-6) << x << ", " << y;
    }
  return counted;
}

Viewpoint at(const Vec3& eye, double yaw, double pitch, double focus) {
  Viewpoint v;
  v.pose = {eye, quat_from_euler({yaw, pitch, 0})};
  v.fov_y_deg = 40;
  v.focus_distance = focus;
  return v;
}

// From anywhere inside of the cylinder, on it and outside of it.
TEST(RingArrays, NoPixelIsCountedTwiceAroundACylinder) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> place(-2.2, 2.2), height(-0.15, 0.15), yaw(-180, 180), pitch(-10, 10);
  for (const bool inward : {true, false}) {
    const Rig rig =
        make_cylinder_rig({.rows = 3, .columns = 12, .pitch = 0.4, .radius = 1.5, .inward = inward, .fov_y_deg = 60});
    const Vec3 middle(0, 0, inward ? 1.5 : 0);
    int owned = 0;
    for (int i = 0; i < 60; i++) {
      const Vec3 eye = middle + Vec3(place(random), height(random), place(random));
      owned += count(rig, at(eye, yaw(random), pitch(random), 2)).owned;
    }
    EXPECT_GT(owned, 60 * kWidth * kHeight / 4);
    // An eye in the middle looks at cameras all around, of which those make the picture that look its way.
    const Counted all = count(rig, at(middle, 77, 0, 3));
    EXPECT_GT(all.owned, all.pixels / 4);
  }
}

TEST(RingArrays, EveryDirectionIsSeenOnceFromACylindersAxis) {
  for (const bool inward : {true, false}) {
    const Rig rig =
        make_cylinder_rig({.rows = 2, .columns = 12, .pitch = 2, .radius = 1, .inward = inward, .fov_y_deg = 90});
    for (int yaw = 0; yaw < 360; yaw += 45) {
      const Counted all = count(rig, at({0, 0, inward ? 1 : 0}, yaw, 0, 3));
      EXPECT_EQ(all.owned, all.pixels) << "no gap where the ring closes, " << yaw;
    }
  }
}

TEST(RingArrays, NoPixelIsCountedTwiceOnACircle) {
  const Rig rig = make_ring_rig({.cameras = 9, .radius = 0.4, .fov_y_deg = 60});
  int owned = 0;
  for (const double z : {-0.7, 0.0, 0.3})
    for (const double x : {0.0, 0.1, -0.3}) owned += count(rig, at({x, 0.05, z}, 0, 0, 2)).owned;
  EXPECT_GT(owned, 4 * kWidth * kHeight);
}

}  // namespace ring_arrays_test
}  // namespace lf
