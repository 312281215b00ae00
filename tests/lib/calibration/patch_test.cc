// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/patch.h"

#include <cmath>
#include <functional>

#include <gtest/gtest.h>

namespace lf {
namespace {

double pattern(const Vec2& p) {
  return 120 + 30 * std::sin(0.5 * p.x + 0.2 * p.y) + 25 * std::sin(0.31 * p.y - 0.2 * p.x + 1) +
         20 * std::cos(0.4 * p.x + 0.45 * p.y);
}

SplineImage picture(const std::function<double(const Vec2&)>& value) {
  Image image(PixelFamily::kRgb, 80, 60);
  for (int y = 0; y < 60; y++)
    for (int x = 0; x < 80; x++)
      for (int c = 0; c < 3; c++) image.pixel(x, y)[c] = static_cast<uint8_t>(std::lround(value(Vec2(x, y))));
  return SplineImage(image);
}

// As another camera sees it: stretched by 8 %, sheared, turned a little, darker and of less contrast.
constexpr Vec2 kPoint(38.3, 29.6), kThere(41.72, 27.18);
double elsewhere(const Vec2& p) {
  const Vec2 d = p - kThere;
  return 0.8 * pattern(kPoint + Vec2(1.08 * d.x + 0.05 * d.y, -0.03 * d.x + 0.97 * d.y)) - 5;
}

TEST(Patch, IsFoundToHundredthsOfAPixelHoweverItIsWarped) {
  const auto patch = Patch::cut(picture(pattern), kPoint);
  ASSERT_TRUE(patch);
  const SplineImage other = picture(elsewhere);
  for (const Vec2& off : {Vec2(0, 0), Vec2(1, 0), Vec2(-0.7, 0.9)}) {
    const auto match = patch->find(other, kThere + off);
    ASSERT_TRUE(match);
    EXPECT_LT(glm::length(match->point - kThere), 0.02);
    EXPECT_GT(match->correlation, 0.999);
  }
}

TEST(Patch, IsNotFoundWhereItIsNot) {
  const auto patch = Patch::cut(picture(pattern), kPoint);
  ASSERT_TRUE(patch);
  const SplineImage other = picture([](const Vec2& p) { return 128 + 40 * std::sin(p.x * p.y * 0.01); });
  const auto match = patch->find(other, Vec2(40, 30));
  EXPECT_TRUE(!match || match->correlation < 0.8);
  EXPECT_FALSE(patch->find(picture(pattern), Vec2(5, 30)));  // the image ends
  EXPECT_FALSE(patch->find(picture([](const Vec2&) { return 100.0; }), Vec2(40, 30)));
}

TEST(Patch, NeedsSomethingToBeFoundBy) {
  EXPECT_FALSE(Patch::cut(picture([](const Vec2&) { return 100.0; }), kPoint));
  EXPECT_FALSE(Patch::cut(picture([](const Vec2& p) { return p.x < 38 ? 50.0 : 200.0; }), kPoint));  // along an edge
  EXPECT_FALSE(Patch::cut(picture(pattern), Vec2(5, 30)));
}

}  // namespace
}  // namespace lf
