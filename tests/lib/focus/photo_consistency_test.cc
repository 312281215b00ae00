// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/photo_consistency.h"

#include "lib/focus/plain_choice.h"
#include "reference/generators.h"
#include "support/every_target.h"
#include "support/test.h"

namespace lf {
namespace moments_test {

PhotoConsistency of(double weight, double luma) {
  PhotoConsistency moments;
  moments.reset(1, 1);
  moments.weight[0] = static_cast<uint16_t>(std::lround(weight * PhotoConsistency::kWeightOne));
  moments.luma[0] = static_cast<uint16_t>(std::lround(weight * luma * PhotoConsistency::kLumaOne));
  moments.square[0] = static_cast<uint16_t>(std::lround(weight * luma * luma));
  return moments;
}

TEST(PhotoConsistency, DeviationIsThatOfTheWeightedLuma) {
  PhotoConsistency sum = of(0.25, 100);
  sum.add(of(0.75, 180));
  EXPECT_NEAR(sum.deviation(0), 80 * std::sqrt(0.25 * 0.75), 0.05);
}

TEST(PhotoConsistency, AgreeingCamerasDoNotDeviate) {
  for (const double luma : {0.0, 17.0, 128.0, 255.0}) {
    PhotoConsistency sum = of(0.3, luma);
    sum.add(of(0.3, luma));
    sum.add(of(0.4, luma));
    EXPECT_LT(sum.deviation(0), 2) << luma << ": rounding of squares to 16 bits";
  }
}

TEST(PhotoConsistency, NeedsHalfOfTheWeight) {
  EXPECT_NEAR(of(0.6, 100).deviation(0), 0, 1.5);
  EXPECT_TRUE(std::isnan(of(0.4, 100).deviation(0)));
  EXPECT_TRUE(std::isnan(of(0, 0).deviation(0)));
}

TEST(PhotoConsistency, SaturatesIfCamerasAreCountedTwice) {
  PhotoConsistency sum = of(1, 255);
  sum.add(of(1, 255));
  sum.add(of(1, 255));
  EXPECT_EQ(sum.weight[0], 65535);
  EXPECT_EQ(sum.luma[0], 65535);
  EXPECT_EQ(sum.square[0], 65535);
}

constexpr int kColumns = 40, kRows = 24;

// Returns the sums of cameras with this luma and total `weight`.
PhotoConsistency consistency_of(const std::function<double(int x, int y)>& luma, double weight = 1) {
  PhotoConsistency m;
  m.reset(kColumns, kRows);
  for (int y = 0; y < kRows; y++)
    for (int x = 0; x < kColumns; x++) {
      const size_t i = static_cast<size_t>(y) * kColumns + x;
      m.weight[i] = static_cast<uint16_t>(weight * PhotoConsistency::kWeightOne);
      m.luma[i] = static_cast<uint16_t>(weight * luma(x, y) * PhotoConsistency::kLumaOne);
    }
  return m;
}
const std::vector<uint8_t> kFirst(kColumns* kRows, 0);

double wall(int, int) { return 200; }
double thing(int x, int y) { return x >= 4 && x < 12 && y >= 4 && y < 10 ? 40 : 200; }

TEST(MovedLight, BlurMovesNoLight) {
  // The same object twice, at half the contrast.
  const PhotoConsistency twice = consistency_of([](int x, int y) { return (thing(x - 2, y) + thing(x + 2, y)) / 2; });
  EXPECT_NEAR(moved_light(std::vector{consistency_of(thing), twice}, kFirst, 1), 0, 1e-6);
}

TEST(MovedLight, MissingObjectsLoseLight) {
  // One quarter has 240 nodes; 48 are 160 levels brighter: 32 in its mean, 0 in all other quarters.
  EXPECT_NEAR(moved_light(std::vector{consistency_of(wall), consistency_of(thing)}, kFirst, 1), 32. * 32 / 4, 1e-2);
}

TEST(MovedLight, UsesTheSelectedHypothesisOfEachNode) {
  const std::vector<PhotoConsistency> hypotheses{consistency_of(wall), consistency_of(thing), consistency_of(thing)};
  std::vector<uint8_t> chosen(kFirst);
  for (int y = 0; y < kRows; y++)
    for (int x = 0; x < kColumns; x++) chosen[static_cast<size_t>(y) * kColumns + x] = thing(x, y) < 100 ? 1 : 0;
  EXPECT_NEAR(moved_light(hypotheses, chosen, 2), 0, 1e-6);
}

TEST(MovedLight, IgnoresPartlyVisibleNodes) {
  const PhotoConsistency half = consistency_of(wall, 0.5);
  EXPECT_EQ(moved_light(std::vector{half, consistency_of(thing)}, kFirst, 1), 0);
  EXPECT_EQ(moved_light(std::vector{consistency_of(thing), half}, kFirst, 1), 0);
}

constexpr float kInfinity = std::numeric_limits<float>::infinity();

TEST(HypothesisCost, DeviationsAreAveragedOverVisibleNodes) {
  PhotoConsistency moments;
  moments.reset(4, 1);
  for (const auto& [node, deviation] : {std::pair{0, 4}, {1, 10}, {3, 6}}) {
    moments.weight[node] = PhotoConsistency::kWeightOne;
    moments.square[node] = static_cast<uint16_t>(deviation * deviation);
  }
  moments.weight[2] = PhotoConsistency::kWeightOne / 2 - 1;
  const std::vector<std::vector<float>> costs = hypothesis_costs({&moments, 1}, 1);
  EXPECT_EQ(costs, (std::vector<std::vector<float>>{{18 / 3.f, 24 / 3.f, kInfinity, 6}}));
}

TEST(HypothesisCost, FewerCamerasDoNotCompete) {
  std::vector<PhotoConsistency> moments(3);
  for (size_t t = 0; t < 3; t++) {
    moments[t].reset(1, 1);
    moments[t].weight[0] = static_cast<uint16_t>(PhotoConsistency::kWeightOne * (t == 2 ? 30 : 32 - t) / 32);
  }
  EXPECT_EQ(hypothesis_costs(moments, 1)[2][0], 0) << "a sixteenth may be missing";
  moments[2].weight[0]--;
  EXPECT_EQ(hypothesis_costs(moments, 1)[1][0], 0);
  EXPECT_EQ(hypothesis_costs(moments, 1)[2][0], kInfinity);
}

TEST(HypothesisCost, MedianIsTheUpperMiddleValue) {
  const auto none = [](std::span<const float> values) { return std::isnan(median_of_finite(values)); };
  EXPECT_TRUE(none({}));
  EXPECT_TRUE(none(std::vector<float>{kInfinity, kInfinity}));
  const float least = std::numeric_limits<float>::denorm_min(), most = std::numeric_limits<float>::max();
  EXPECT_EQ(median_of_finite(std::vector<float>{kInfinity, 3}), 3);
  EXPECT_EQ(median_of_finite(std::vector<float>{3, 1}), 3);
  EXPECT_EQ(median_of_finite(std::vector<float>{0, least, most, kInfinity}), least);
  EXPECT_EQ(median_of_finite(std::vector<float>{most, most, 0, 1}), most);
  reference::Random random(2);
  test::on_every_target([&] {
    for (int n = 1; n < 100; n++) {
      std::vector<float> values(n);
      for (float& value : values) {
        value = static_cast<float>(std::exp(random.uniform(-90, 90)));
        if (random.uniform(0, 1) < 0.2) value = random.uniform(0, 1) < 0.5 ? kInfinity : 7;
      }
      const double plain = test::plain_median(values);
      if (std::isnan(plain))
        EXPECT_TRUE(none(values));
      else
        EXPECT_EQ(median_of_finite(values), plain);
    }
  });
}

TEST(HypothesisCost, FirstHypothesisWinsTies) {
  const std::vector<std::vector<float>> costs{
      {5, 5, kInfinity, kInfinity}, {4, 4.5, 8, kInfinity}, {4, 3, 8, kInfinity}};
  float best[4];
  uint8_t chosen[4];
  cheapest_hypotheses(costs, std::vector<float>(4, 0.5f), best, chosen);
  EXPECT_EQ(std::vector<int>(chosen, chosen + 4), (std::vector<int>{1, 2, 1, 0}));
  EXPECT_EQ(std::vector<float>(best, best + 4), (std::vector<float>{4.5, 3.5, 8.5, kInfinity}));
}

TEST(HypothesisCost, EachNodeHasItsOwnLead) {
  const std::vector<std::vector<float>> costs{{5, 5, 5, kInfinity}, {4, 4, 4, 4}};
  float best[4];
  uint8_t chosen[4];
  cheapest_hypotheses(costs, std::vector<float>{0.5, 1, kInfinity, kInfinity}, best, chosen);
  EXPECT_EQ(std::vector<int>(chosen, chosen + 4), (std::vector<int>{1, 0, 0, 0}));
  EXPECT_EQ(std::vector<float>(best, best + 4), (std::vector<float>{4.5, 5, 5, kInfinity}));
}

}  // namespace moments_test

}  // namespace lf
