// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/pattern.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace lf::scene {
namespace {

// Mean of f over an interval of width w around x, by sampling.
template <typename F>
double mean(F&& f, double x, double w) {
  constexpr int kSteps = 4000;
  double sum = 0;
  for (int i = 0; i < kSteps; i++) sum += f(x + w * ((i + 0.5) / kSteps - 0.5));
  return sum / kSteps;
}

double fraction(double x) { return x - std::floor(x); }

TEST(Pattern, CosineOfTurns) {
  for (double x = -7; x < 7; x += 0.0137) EXPECT_NEAR(cos_turns(static_cast<float>(x)), std::cos(2 * M_PI * x), 2e-4);
}

TEST(Pattern, FloorAndFraction) {
  for (const float x : {-3.0f, -2.5f, -0.25f, 0.0f, 0.5f, 0.999f, 1.0f, 1.5f, 1000.75f}) {
    EXPECT_EQ(floor_of(x), std::floor(x)) << x;
    EXPECT_EQ(fraction_of(x), x - std::floor(x)) << x;
  }
}

TEST(Pattern, FilteredPatternsAreAverages) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> position(-4, 4), width(0.01f, 3);
  for (int i = 0; i < 200; i++) {
    const float x = position(random), w = width(random);
    EXPECT_NEAR(stripes(x, w, 0.3f), mean([](double v) { return fraction(v) < 0.3 ? 1 : 0; }, x, w), 2e-3);
    if (w < 1) {
      EXPECT_NEAR(wave(x, w), mean([](double v) { return std::cos(2 * M_PI * v); }, x, w), 6e-3);
    }
    const float y = position(random), wy = width(random);
    const auto sign = [](double v) { return fraction(v / 2) < 0.5 ? 1.0 : -1.0; };
    EXPECT_NEAR(checker(x, w, y, wy), 0.5 + 0.5 * mean(sign, x, w) * mean(sign, y, wy), 4e-3);
  }
}

TEST(Pattern, FineTextureFadesToItsMean) {
  EXPECT_EQ(wave(0.3f, 1), 0);
  EXPECT_NEAR(checker(0.2f, 4, 0.7f, 4), 0.5, 1e-6);
  EXPECT_NEAR(grain(0.2f, 3, 0.7f, 3), 0, 1e-6);
  EXPECT_LE(std::abs(grain(0.2f, 0, 0.7f, 0)), 1);
}

TEST(Pattern, ScatterSpreadsOverTheUnitInterval) {
  double sum = 0, squares = 0;
  for (int a = -50; a < 50; a++)
    for (int b = -50; b < 50; b++) {
      const double v = scatter(a, b);
      ASSERT_TRUE(v >= 0 && v <= 1);
      sum += v;
      squares += v * v;
    }
  EXPECT_NEAR(sum / 1e4, 0.5, 0.02);
  EXPECT_NEAR(squares / 1e4, 1.0 / 3, 0.02);
}

}  // namespace
}  // namespace lf::scene
