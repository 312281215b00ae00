// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/surface_choice.h"

#include <gtest/gtest.h>

#include <cmath>

#include "lib/focus/every_target.h"
#include "lib/focus/plain_choice.h"
#include "reference/generators.h"

namespace lf {
namespace {

constexpr int kColumns = 12, kRows = 10;

// Moments of the deviations given, of cameras that all see everything.
Moments deviating(const auto& deviation) {
  Moments moments;
  moments.reset(kColumns, kRows);
  for (int j = 0; j < kRows; j++)
    for (int i = 0; i < kColumns; i++) {
      const size_t node = static_cast<size_t>(j) * kColumns + i;
      const double sigma = deviation(i, j);
      moments.weight[node] = Moments::kWeightOne;
      moments.luma[node] = 100 * Moments::kLumaOne;
      moments.square[node] = static_cast<uint16_t>(std::lround(100 * 100 + sigma * sigma));
    }
  return moments;
}

FocalMap flat(uint8_t level) {
  FocalMap map;
  map.columns = kColumns;
  map.rows = kRows;
  map.levels.assign(kColumns * kRows, level);
  return map;
}

TEST(SurfaceChoice, TakesTheTrialThroughWhichCamerasAgree) {
  const std::vector<std::vector<uint8_t>> trials{std::vector<uint8_t>(kColumns * kRows, 50),
                                                 std::vector<uint8_t>(kColumns * kRows, 90)};
  const std::vector<Moments> moments{deviating([](int i, int) { return i < 6 ? 2 : 20; }),
                                     deviating([](int i, int) { return i < 6 ? 20 : 2; })};
  const SurfaceChoice choice = choose_surface(flat(50), trials, moments);
  for (int j = 0; j < kRows; j++)
    for (int i = 0; i < kColumns; i++) EXPECT_EQ(choice.levels[j * kColumns + i], i < 6 ? 50 : 90) << i << ", " << j;
  EXPECT_NEAR(choice.changed, 0.5, 1e-9);
  EXPECT_GT(choice.gained, 5);
  EXPECT_NEAR(choice.cost[0], choice.cost[1], 0.1);
}

TEST(SurfaceChoice, ANodeItselfCountsForMoreThanItsNeighbours) {
  const std::vector<std::vector<uint8_t>> trials{std::vector<uint8_t>(kColumns * kRows, 50),
                                                 std::vector<uint8_t>(kColumns * kRows, 90)};
  const std::vector<Moments> moments{deviating([](int, int) { return 5.6; }),
                                     deviating([](int i, int) { return i == 6 ? 2 : 8; })};  // 6 on average
  const SurfaceChoice choice = choose_surface(flat(50), trials, moments);
  EXPECT_EQ(choice.levels[3 * kColumns + 6], 90);
  EXPECT_EQ(choice.levels[3 * kColumns + 5], 50);
}

TEST(SurfaceChoice, ALeadKeepsWhatNothingTellsApart) {
  const std::vector<std::vector<uint8_t>> trials{std::vector<uint8_t>(kColumns * kRows, 50),
                                                 std::vector<uint8_t>(kColumns * kRows, 90)};
  const auto with = [&](double other) {
    const std::vector<Moments> moments{deviating([](int, int) { return 10.0; }),
                                       deviating([&](int, int) { return other; })};
    return choose_surface(flat(50), trials, moments).levels[0];
  };
  EXPECT_EQ(with(9.7), 50) << "within the lead";
  EXPECT_EQ(with(9), 90);
}

TEST(SurfaceChoice, KeepsTheLevelWhereNothingIsSeen) {
  std::vector<Moments> moments{deviating([](int, int) { return 10; }), deviating([](int, int) { return 1; })};
  for (Moments& m : moments) m.weight[5] = 0;
  const std::vector<std::vector<uint8_t>> trials{std::vector<uint8_t>(kColumns * kRows, 50),
                                                 std::vector<uint8_t>(kColumns * kRows, 90)};
  const SurfaceChoice choice = choose_surface(flat(77), trials, moments);
  EXPECT_EQ(choice.levels[5], 77);
  EXPECT_EQ(choice.levels[6], 90);
  std::vector<Moments> nothing(2);
  for (Moments& m : nothing) m.reset(kColumns, kRows);
  EXPECT_EQ(choose_surface(flat(77), trials, nothing).levels, flat(77).levels);
  EXPECT_TRUE(std::isnan(choose_surface(flat(77), trials, nothing).residual));
}

// To the bit, of maps of any size, of cameras that agree and that do not, and of weights and sums that no cameras have.
TEST(SurfaceChoice, IsThePlainOneWithEveryInstructionSet) {
  reference::Random random(7);
  const auto below = [&](int end) { return static_cast<int>(random.uniform(0, end)); };
  const auto same = [](double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); };
  for (int round = 0; round < 60; round++) {
    FocalMap map;
    map.columns = 1 + below(round % 2 ? 9 : 90);
    map.rows = 1 + below(20);
    const size_t nodes = static_cast<size_t>(map.columns) * map.rows, count = 1 + static_cast<size_t>(below(5));
    map.levels.assign(nodes, 77);
    std::vector<std::vector<uint8_t>> trials;
    std::vector<Moments> moments(count);
    const double missing = round % 3 == 0 ? 0 : random.uniform(0, 1), wild = round % 4 == 0 ? 0.2 : 0;
    for (size_t t = 0; t < count; t++) {
      trials.emplace_back(nodes, static_cast<uint8_t>(t + 1));
      moments[t].reset(map.columns, map.rows);
      for (size_t i = 0; i < nodes; i++) {
        const double weight = random.uniform(0, 1) < missing ? random.uniform(0, 1) : 1, luma = random.uniform(0, 255);
        const double square = luma * luma + std::pow(below(round % 5 == 0 ? 1 : 30), 2);
        moments[t].weight[i] = static_cast<uint16_t>(weight * Moments::kWeightOne);
        moments[t].luma[i] = static_cast<uint16_t>(weight * luma * Moments::kLumaOne);
        moments[t].square[i] = static_cast<uint16_t>(std::min(weight * square, 65535.));
        for (std::vector<uint16_t>* sum : {&moments[t].weight, &moments[t].luma, &moments[t].square})
          if (random.uniform(0, 1) < wild) (*sum)[i] = static_cast<uint16_t>(below(4) == 0 ? 65535 : below(65536));
      }
    }
    for (const int radius : {0, 1, 4}) {
      const SurfaceChoice plain = test::plain_choice(map, trials, moments, radius);
      test::on_every_target([&] {
        const SurfaceChoice choice = choose_surface(map, trials, moments, radius);
        EXPECT_EQ(choice.levels, plain.levels);
        EXPECT_TRUE(same(choice.residual, plain.residual)) << choice.residual << ", " << plain.residual;
        EXPECT_TRUE(same(choice.gained, plain.gained)) << choice.gained << ", " << plain.gained;
        EXPECT_EQ(choice.changed, plain.changed);
        EXPECT_TRUE(std::ranges::equal(choice.cost, plain.cost, same));
      });
    }
  }
}

}  // namespace
}  // namespace lf
