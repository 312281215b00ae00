// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/mean_luma.h"

#include <gtest/gtest.h>

#include <cmath>

namespace lf {
namespace {

// Of n cameras that see luma v everywhere, of weight w.
Moments grey(int columns, int rows, double w, double v) {
  Moments moments;
  moments.reset(columns, rows);
  for (size_t i = 0; i < moments.weight.size(); i++) {
    moments.weight[i] = static_cast<uint16_t>(w * Moments::kWeightOne);
    moments.luma[i] = static_cast<uint16_t>(w * v * Moments::kLumaOne);
    moments.square[i] = static_cast<uint16_t>(w * v * v);
  }
  return moments;
}

TEST(MeanLuma, IsTheMeanButAtTheBorder) {
  const std::vector<uint8_t> mean = mean_luma(grey(5, 4, 0.7, 100), {});
  for (int y = 0; y < 4; y++)
    for (int x = 0; x < 5; x++)
      EXPECT_EQ(mean[y * 5 + x], x > 0 && x < 4 && y > 0 && y < 3 ? 100 : 0) << x << ", " << y;
}

TEST(MeanLuma, OnlyWhereItIsWellDefined) {
  const auto middle = [](const Moments& moments) { return mean_luma(moments, {})[4]; };
  EXPECT_EQ(middle(grey(3, 3, 0.1, 100)), 0) << "few cameras";
  EXPECT_EQ(middle(grey(3, 3, 0.7, 5)), 0) << "black";
  EXPECT_EQ(middle(grey(3, 3, 0.7, 252)), 0) << "white";
  Moments moments = grey(3, 3, 0.7, 100);
  moments.square[4] = static_cast<uint16_t>(moments.square[4] * 1.2);
  EXPECT_EQ(middle(moments), 0) << "cameras disagree";
  moments = grey(3, 3, 0.7, 100);
  moments.luma[5] = moments.luma[5] / 2;
  EXPECT_EQ(middle(moments), 0) << "an edge";
}

TEST(MeanLuma, DoesNotFollowTheGains) {
  GainSum gains;
  gains.add(1.25f, 0.125f);
  gains.add(1.25f, 0.03f);
  EXPECT_NEAR(gains.mean(), 1.25, 1e-3);
  EXPECT_EQ(mean_luma(grey(3, 3, 0.7, 80), gains)[4], 100) << "what was seen before it was divided by them";
}

TEST(GainSum, IsGeometricAndAddsUp) {
  EXPECT_EQ(GainSum{}.mean(), 1);
  GainSum all, a, b;
  all.add(2, 0.125f);
  a.add(2, 0.125f);
  all.add(0.5f, 0.0625f);
  b.add(0.5f, 0.0625f);
  a.add(b);
  EXPECT_EQ(a, all);
  EXPECT_NEAR(all.mean(), std::exp2((2. - 1) / 3), 1e-3);
}

}  // namespace
}  // namespace lf
