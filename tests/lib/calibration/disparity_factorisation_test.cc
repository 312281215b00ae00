// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/disparity_factorisation.h"

#include <random>

#include <gtest/gtest.h>

namespace lf {
namespace {

// Sights of random points by a 4x4 array whose cameras are turned a little, a share of them replaced.
std::vector<ColumnSight> make_sights(double missed, double mistaken, std::vector<Vec2>& centres) {
  std::mt19937 random(3);
  const auto uniform = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); };
  std::vector<Vec2> turns;
  for (int i = 0; i < 16; i++) {
    centres.emplace_back(i % 4 - 1.5, i / 4 - 1.5);
    turns.emplace_back(uniform(-0.02, 0.02), uniform(-0.02, 0.02));
  }
  std::vector<ColumnSight> sights;
  for (uint32_t j = 0; j < 60; j++) {
    const Vec2 direction(uniform(-0.3, 0.3), uniform(-0.3, 0.3));
    const double disparity = uniform(0.02, 0.08);
    for (uint32_t i = 0; i < 16; i++) {
      if (uniform(0, 1) < missed) continue;
      Vec2 uv = direction - centres[i] * disparity + turns[i];
      if (uniform(0, 1) < mistaken) uv = {uniform(-0.4, 0.4), uniform(-0.3, 0.3)};
      sights.push_back({i, j, uv});
    }
  }
  return sights;
}

// The layout up to a scale that is the same for all.
void expect_layout(const DisparityFactors& factors, const std::vector<Vec2>& centres, double tolerance) {
  double cc = 0, cf = 0;
  for (size_t i = 0; i < centres.size(); i++)
    cc += glm::dot(factors.cameras[i].centre, factors.cameras[i].centre),
        cf += glm::dot(factors.cameras[i].centre, centres[i]);
  for (size_t i = 0; i < centres.size(); i++)
    EXPECT_LE(glm::length(factors.cameras[i].centre * (cf / cc) - centres[i]), tolerance) << i;
}

TEST(DisparityFactorisation, ExactSightsGiveTheLayout) {
  std::vector<Vec2> centres;
  const auto factors = factorise_disparities(make_sights(0, 0, centres), 16, 60, 0.02);
  expect_layout(factors, centres, 1e-2);
  EXPECT_EQ(factors.inliers, 1);
  for (const auto& column : factors.columns) EXPECT_GT(column.disparity, 0);
}

TEST(DisparityFactorisation, MissesAndMistakesDoNotMatter) {
  std::vector<Vec2> centres;
  const auto factors = factorise_disparities(make_sights(0.3, 0.15, centres), 16, 60, 0.02);
  expect_layout(factors, centres, 0.05);
  EXPECT_NEAR(factors.inliers, 0.85, 0.05);
}

TEST(DisparityFactorisation, ACameraThatSeesNothingIsUnknown) {
  std::vector<Vec2> centres;
  std::vector<ColumnSight> sights = make_sights(0, 0, centres);
  std::erase_if(sights, [](const ColumnSight& s) { return s.camera == 5; });
  const auto factors = factorise_disparities(sights, 16, 60, 0.02);
  EXPECT_EQ(factors.cameras[5].inliers, 0);
  EXPECT_EQ(factors.inliers, 1);
}

TEST(DisparityFactorisation, TooLittleGivesNothing) { EXPECT_EQ(factorise_disparities({}, 3, 4, 0.02).inliers, 0); }

}  // namespace
}  // namespace lf
