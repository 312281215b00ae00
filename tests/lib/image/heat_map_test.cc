// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/heat_map.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "support/expect_error.h"

namespace lf {
namespace {

double brightness(const std::array<uint8_t, 3>& c) { return 0.299 * c[0] + 0.587 * c[1] + 0.114 * c[2]; }

TEST(HeatColour, GrowsBrighterFromBlackToYellow) {
  EXPECT_LT(brightness(heat_colour(0)), 1);
  EXPECT_GT(brightness(heat_colour(1)), 230);
  for (int i = 1; i <= 200; i++)
    EXPECT_GE(brightness(heat_colour(i / 200.0)), brightness(heat_colour((i - 1) / 200.0)) - 0.5) << i;
  EXPECT_EQ(heat_colour(-3), heat_colour(0));
  EXPECT_EQ(heat_colour(7), heat_colour(1));
  EXPECT_EQ(heat_colour(0.5), (std::array<uint8_t, 3>{188, 55, 84}));
}

TEST(HeatColour, IsNeverTheGreyOfNoValue) {
  for (int i = 0; i <= 1000; i++)
    EXPECT_NE(heat_colour(i / 1000.0), (std::array<uint8_t, 3>{kNoHeat, kNoHeat, kNoHeat}));
}

TEST(HeatMap, ShowsValuesAgainstTheEndOfTheScale) {
  const std::vector<float> values{0, 5, 10, 20, NAN, 2.5};
  const Image map = heat_map(values, 3, 2, 10);
  const auto at = [&](int x, int y) {
    return std::array<uint8_t, 3>{map.pixel(x, y)[0], map.pixel(x, y)[1], map.pixel(x, y)[2]};
  };
  EXPECT_EQ(at(0, 0), heat_colour(0));
  EXPECT_EQ(at(1, 0), heat_colour(0.5));
  EXPECT_EQ(at(2, 0), heat_colour(1));
  EXPECT_EQ(at(0, 1), heat_colour(1)) << "beyond the scale";
  EXPECT_EQ(at(1, 1), (std::array<uint8_t, 3>{kNoHeat, kNoHeat, kNoHeat}));
  EXPECT_EQ(at(2, 1), heat_colour(0.25));
}

TEST(HeatMap, APictureShowsThroughWhereThereIsNoHeat) {
  Image under(PixelFamily::kRgb, 2, 1);
  for (uint8_t& v : under.data()) v = 200;
  const Image map = heat_map(std::vector<float>{0, 1}, 2, 1, 1, &under);
  EXPECT_NEAR(map.pixel(0, 0)[1], 80, 1);
  EXPECT_EQ(map.pixel(1, 0)[1], heat_colour(1)[1]);
  EXPECT_ERROR(heat_map(std::vector<float>{0, 1}, 1, 2, 1, &under), "of one size");
  EXPECT_ERROR(heat_map(std::vector<float>{0, 1, 2}, 2, 1, 1), "of one size");
}

}  // namespace
}  // namespace lf
