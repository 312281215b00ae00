// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/colour_model.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace lf {
namespace {

using testing::HasSubstr;
using testing::Optional;

TEST(ColourModel, TheDefaultLeavesColoursAsTheyAre) {
  for (const Vec3& level : {Vec3(0, 0, 0), Vec3(255, 255, 255), Vec3(1, 128, 254)})
    EXPECT_LE(glm::length(corrected({}, level) - level), 1e-9);
  EXPECT_EQ(level_factor(light_share({}, 1)), 1);
}

TEST(ColourModel, IsTheFormulaOfItsHeader) {
  const ColourModel model{.black = {4, 6, 8}, .gamma = 2, .matrix = {1.1, -.1, 0, 0, 1, 0, 0, .05, .9}};
  const double r = 100 - 4, g = 150 - 6, b = 200 - 8;
  const auto light = [](double v) { return std::pow(v / 255, 2); };
  const auto level = [](double l) { return 255 * std::pow(l, 1 / 2.2); };
  const Vec3 out = corrected(model, {100, 150, 200});
  EXPECT_NEAR(out.x, level(1.1 * light(r) - .1 * light(g)), 1e-9);
  EXPECT_NEAR(out.y, level(light(g)), 1e-9);
  EXPECT_NEAR(out.z, level(.05 * light(g) + .9 * light(b)), 1e-9);
}

TEST(ColourModel, WhatIsBelowBlackIsBelowZeroSoThatNoiseAveragesOut) {
  const ColourModel model{.black = {8, 8, 8}};
  EXPECT_NEAR(corrected(model, {-20, 8, 11}).x, -28, 1e-9);
  EXPECT_NEAR(corrected(model, {5, 8, 11}).x, -3, 1e-9);
  EXPECT_NEAR(corrected(model, {5, 8, 11}).y, 0, 1e-9);
  EXPECT_NEAR(corrected(model, {5, 8, 11}).z, 3, 1e-9);
}

TEST(ColourModel, LightIsAPowerAboveTheToeAndALineBelow) {
  EXPECT_NEAR(light_of(128), std::pow(128 / 255., 2.2), 1e-12);
  EXPECT_NEAR(light_of(128, 1.8), std::pow(128 / 255., 1.8), 1e-12);
  EXPECT_NEAR(light_of(15), std::pow(30 / 255., 2.2) / 2, 1e-12);
  EXPECT_NEAR(light_of(-8), -light_of(8), 1e-12);
  for (const double gamma : {1.0, 2.2, 2.6})
    for (const double level : {-300.0, -30.0, -1.0, 0.0, 0.5, 29.99, 30.01, 200.0, 400.0})
      EXPECT_NEAR(level_of(light_of(level, gamma), gamma), level, 1e-9);
}

TEST(ColourModel, VignettingIsAboutThePrincipalPointInHalfDiagonals) {
  const VignettingField field(301, 401, {150, 200});
  EXPECT_EQ(field.square(150, 200), 0);
  EXPECT_NEAR(field.square(0, 0), (150. * 150 + 200. * 200) / (301. * 301 + 401. * 401) * 4, 1e-12);
  EXPECT_EQ(field.most(), field.square(300, 400));
  const VignettingField shifted(301, 401, {140, 200});
  EXPECT_EQ(shifted.most(), shifted.square(300, 0)) << "the farthest corner";
  const ColourModel model{.vignetting = {-0.4, 0.1}};
  EXPECT_NEAR(light_share(model, 1), 0.7, 1e-12);
  EXPECT_NEAR(255 * std::pow(0.7, 1 / 2.2) * level_factor(0.7), 255, 1e-9) << "a factor of the levels";
}

TEST(ColourModel, FaultsNameThePlaceAndTheBounds) {
  EXPECT_EQ(fault_of({}, 1), std::nullopt);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(fault_of({.black = {0, 70, 0}}, 1), Optional(HasSubstr("black[1]: must be -64 to 64")));
  EXPECT_THAT(fault_of({.black = {0, 0, nan}}, 1), Optional(HasSubstr("black[2]")));
  EXPECT_THAT(fault_of({.gamma = 0.2}, 1), Optional(HasSubstr("gamma: must be 0.5 to 5")));
  EXPECT_THAT(fault_of({.gamma = nan}, 1), Optional(HasSubstr("gamma")));
  EXPECT_THAT(fault_of({.matrix = {1, 0, 0, 0, 1, 0, 0, 0, 4.1}}, 1), Optional(HasSubstr("matrix[8]")));
  EXPECT_THAT(fault_of({.matrix = {1, 1, 0, 1, 1, 0, 0, 0, 1}}, 1), Optional(HasSubstr("determinant")));
  EXPECT_THAT(fault_of({.vignetting = {-0.8, 0}}, 1), Optional(HasSubstr("vignetting: must leave 0.25 to 2.5")));
  EXPECT_EQ(fault_of({.vignetting = {-0.74, 0}}, 1), std::nullopt);
  EXPECT_THAT(fault_of({.vignetting = {-0.74, 0}}, 1.1), Optional(HasSubstr("vignetting")))
      << "an image that is larger";
  EXPECT_THAT(fault_of({.vignetting = {-4, 4}}, 1), Optional(HasSubstr("vignetting")))
      << "dark half-way, not at the end";
  EXPECT_THAT(fault_of({.vignetting = {nan, 0}}, 1), Optional(HasSubstr("vignetting")));
}

}  // namespace
}  // namespace lf
