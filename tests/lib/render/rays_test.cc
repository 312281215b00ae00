// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/rays.h"

#include <cstring>

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

// A table of a large view takes seconds: it is made in parts, which others may go between.
TEST(Rays, TablesAreMadeInParts) {
  const Lens lens(LensModel::kRadial, {300, 99.5, 70.25, -0.21, 0.0417});
  size_t parts = 0;
  const Rays in_parts(lens, 200, 141, [&parts](size_t count, const std::function<void(size_t)>& task) {
    parts += count;
    for (size_t i = count; i-- > 0;) task(i);
  });
  EXPECT_GE(parts, 100u);
  for (int y = 0; y < 141; y++)
    for (int x = 0; x < 200; x++) {
      const Vec2 ray = in_parts.at(x, y), alone = *lens.unproject({x, y});
      ASSERT_EQ(std::memcmp(&ray, &alone, sizeof ray), 0) << x << ", " << y;
    }
}

TEST(Rays, TheTableOfALensIsMadeOnce) {
  const Lens lens(LensModel::kRadial, {301, 99.5, 70.25, -0.21, 0.0417}), other = lens.shifted({1, 0});
  size_t made = 0;
  const ParallelFor counted = [&made](size_t count, const std::function<void(size_t)>& task) {
    made++;
    serial_for(count, task);
  };
  const Rays first(lens, 64, 48, counted);
  const Rays again(lens, 64, 48, counted);
  EXPECT_EQ(made, 1u);
  const Rays larger(lens, 65, 48, counted), beside(other, 64, 48, counted);
  EXPECT_EQ(made, 3u);
  EXPECT_EQ(first.at(20, 30), again.at(20, 30));
  EXPECT_NE(first.at(20, 30), beside.at(20, 30));
}

TEST(Rays, ChromaOfTheLastOddPixelIsThatPixels) {
  for (const double k1 : {0.0, -0.1}) {
    const Rays rays(Lens(LensModel::kSimpleRadial, {30, 2, 2, k1}), 5, 5);
    EXPECT_EQ(rays.at_centre_of_four(4, 4), rays.at(4, 4));
  }
}

}  // namespace
}  // namespace lf
