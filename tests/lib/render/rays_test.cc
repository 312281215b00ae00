// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/rays.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

TEST(Rays, PinholeRaysAreComputed) {
  const Lens lens(LensModel::kPinhole, {100, 200, 9.5, 4.5});
  const Rays rays(lens, 20, 10);
  EXPECT_TRUE(rays.separable());
  EXPECT_NEAR(rays.at(0, 0).x, -0.095, 1e-15);
  EXPECT_NEAR(rays.at(0, 0).y, -0.0225, 1e-15);
  EXPECT_NEAR(rays.at_centre_of_four(2, 2).x, (2.5 - 9.5) / 100, 1e-15);
}

TEST(Rays, DistortedRaysProjectBackToTheirPixels) {
  const Lens lens(LensModel::kRadial, {30, 9.5, 7.5, -0.2, 0.04});
  const Rays rays(lens, 20, 16);
  EXPECT_FALSE(rays.separable());
  for (int y = 0; y < 16; y++)
    for (int x = 0; x < 20; x++) {
      const Vec2 ray = rays.at(x, y);
      const std::optional<Vec2> pixel = lens.project(Vec3(ray, 1));
      ASSERT_TRUE(pixel) << x << ", " << y;
      EXPECT_NEAR(pixel->x, x, 1e-9);
      EXPECT_NEAR(pixel->y, y, 1e-9);
    }
}

TEST(Rays, PixelsBeyondTheFoldHaveNone) {
  const Lens lens(LensModel::kSimpleRadial, {10, 31.5, 31.5, -0.5});  // sees a disc only
  const Rays rays(lens, 64, 64);
  EXPECT_TRUE(std::isnan(rays.at(0, 0).x));
  EXPECT_FALSE(std::isnan(rays.at(32, 32).x));
}

TEST(Rays, ChromaOfTheLastOddPixelIsThatPixels) {
  for (const double k1 : {0.0, -0.1}) {
    const Rays rays(Lens(LensModel::kSimpleRadial, {30, 2, 2, k1}), 5, 5);
    EXPECT_EQ(rays.at_centre_of_four(4, 4), rays.at(4, 4));
  }
}

}  // namespace
}  // namespace lf
