// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/trial_cost.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "lib/focus/every_target.h"
#include "lib/focus/plain_choice.h"
#include "reference/generators.h"

namespace lf {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

TEST(TrialCost, DeviationsAreSmoothedOverTheNodesThatHaveOne) {
  Moments moments;
  moments.reset(4, 1);
  for (const auto& [node, deviation] : {std::pair{0, 4}, {1, 10}, {3, 6}}) {
    moments.weight[node] = Moments::kWeightOne;
    moments.square[node] = static_cast<uint16_t>(deviation * deviation);
  }
  moments.weight[2] = Moments::kWeightOne / 2 - 1;  // not half of the cameras
  const std::vector<std::vector<float>> costs = trial_costs({&moments, 1}, 1);
  EXPECT_EQ(costs, (std::vector<std::vector<float>>{{18 / 3.f, 24 / 3.f, kInfinity, 6}}));
}

TEST(TrialCost, FewerCamerasDoNotCompete) {
  std::vector<Moments> moments(3);
  for (size_t t = 0; t < 3; t++) {
    moments[t].reset(1, 1);
    moments[t].weight[0] = static_cast<uint16_t>(Moments::kWeightOne * (t == 2 ? 30 : 32 - t) / 32);
  }
  EXPECT_EQ(trial_costs(moments, 1)[2][0], 0) << "a sixteenth may be missing";
  moments[2].weight[0]--;
  EXPECT_EQ(trial_costs(moments, 1)[1][0], 0);
  EXPECT_EQ(trial_costs(moments, 1)[2][0], kInfinity);
}

TEST(TrialCost, MedianIsTheUpperOfTheTwoInTheMiddle) {
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

TEST(TrialCost, TheFirstOfTheCheapestWins) {
  const std::vector<std::vector<float>> costs{
      {5, 5, kInfinity, kInfinity}, {4, 4.5, 8, kInfinity}, {4, 3, 8, kInfinity}};
  float best[4];
  uint8_t chosen[4];
  cheapest_trials(costs, std::vector<float>(4, 0.5f), best, chosen);
  EXPECT_EQ(std::vector<int>(chosen, chosen + 4), (std::vector<int>{1, 2, 1, 0}));
  EXPECT_EQ(std::vector<float>(best, best + 4), (std::vector<float>{4.5, 3.5, 8.5, kInfinity}));
}

TEST(TrialCost, EachNodeHasItsOwnLead) {
  const std::vector<std::vector<float>> costs{{5, 5, 5, kInfinity}, {4, 4, 4, 4}};
  float best[4];
  uint8_t chosen[4];
  cheapest_trials(costs, std::vector<float>{0.5, 1, kInfinity, kInfinity}, best, chosen);
  EXPECT_EQ(std::vector<int>(chosen, chosen + 4), (std::vector<int>{1, 0, 0, 0}));
  EXPECT_EQ(std::vector<float>(best, best + 4), (std::vector<float>{4.5, 5, 5, kInfinity}));
}

}  // namespace
}  // namespace lf
