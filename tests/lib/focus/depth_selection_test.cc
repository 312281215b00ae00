// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/depth_selection.h"

#include "lib/focus/plain_choice.h"
#include "reference/generators.h"
#include "support/every_target.h"
#include "support/test.h"

namespace lf {
namespace surface_choice_test {

constexpr int kColumns = 12, kRows = 10;

// Sums with the given deviations, of cameras that see all nodes.
PhotoConsistency deviating(const auto& deviation) {
  PhotoConsistency moments;
  moments.reset(kColumns, kRows);
  for (int j = 0; j < kRows; j++)
    for (int i = 0; i < kColumns; i++) {
      const size_t node = static_cast<size_t>(j) * kColumns + i;
      const double sigma = deviation(i, j);
      moments.weight[node] = PhotoConsistency::kWeightOne;
      moments.luma[node] = 100 * PhotoConsistency::kLumaOne;
      moments.square[node] = static_cast<uint16_t>(std::lround(100 * 100 + sigma * sigma));
    }
  return moments;
}

// By default the cameras can distinguish depths at all nodes.
DepthSelection choose(const FocalMap& map, const std::vector<std::vector<uint8_t>>& hypotheses,
                      const std::vector<PhotoConsistency>& moments, std::vector<float> evidence = {}) {
  if (evidence.empty()) evidence.assign(map.levels.size(), 1);
  return select_depths(map, hypotheses, moments, {.evidence = evidence});
}

FocalMap flat(uint8_t level) {
  FocalMap map;
  map.columns = kColumns;
  map.rows = kRows;
  map.levels.assign(kColumns * kRows, level);
  return map;
}

TEST(DepthSelection, SelectsTheDepthOfBestAgreement) {
  const std::vector<std::vector<uint8_t>> hypotheses{std::vector<uint8_t>(kColumns * kRows, 50),
                                                     std::vector<uint8_t>(kColumns * kRows, 90)};
  const std::vector<PhotoConsistency> moments{deviating([](int i, int) { return i < 6 ? 2 : 20; }),
                                              deviating([](int i, int) { return i < 6 ? 20 : 2; })};
  const DepthSelection choice = choose(flat(50), hypotheses, moments);
  for (int j = 0; j < kRows; j++)
    for (int i = 0; i < kColumns; i++) EXPECT_EQ(choice.levels[j * kColumns + i], i < 6 ? 50 : 90) << i << ", " << j;
  EXPECT_EQ(std::ranges::count(choice.chosen, 1), kColumns * kRows / 2);
  EXPECT_GT(choice.gained, 5);
  EXPECT_NEAR(choice.cost[0], choice.cost[1], 0.1);
}

TEST(DepthSelection, NodeCountsMoreThanItsNeighbours) {
  // The levels are so close that a node need not agree with its neighbours.
  const std::vector<std::vector<uint8_t>> hypotheses{std::vector<uint8_t>(kColumns * kRows, 50),
                                                     std::vector<uint8_t>(kColumns * kRows, 51)};
  const std::vector<PhotoConsistency> moments{deviating([](int, int) { return 5.9; }),
                                              deviating([](int i, int) { return i == 6 ? 2 : 8; })};  // 6 on average
  const DepthSelection choice = choose(flat(50), hypotheses, moments);
  EXPECT_EQ(choice.levels[3 * kColumns + 6], 51);
  EXPECT_EQ(choice.levels[3 * kColumns + 5], 50);
}

TEST(DepthSelection, LeadDecidesBetweenEqualDepths) {
  const std::vector<std::vector<uint8_t>> hypotheses{std::vector<uint8_t>(kColumns * kRows, 50),
                                                     std::vector<uint8_t>(kColumns * kRows, 90)};
  const auto with = [&](double other) {
    const std::vector<PhotoConsistency> moments{deviating([](int, int) { return 10.0; }),
                                                deviating([&](int, int) { return other; })};
    return choose(flat(50), hypotheses, moments).levels[0];
  };
  EXPECT_EQ(with(9.7), 50) << "within the lead";
  EXPECT_EQ(with(9), 90);
}

TEST(DepthSelection, KeepsTheLevelOfInvisibleNodes) {
  std::vector<PhotoConsistency> moments{deviating([](int, int) { return 10; }), deviating([](int, int) { return 1; })};
  for (PhotoConsistency& m : moments) m.weight[5] = 0;
  const std::vector<std::vector<uint8_t>> hypotheses{std::vector<uint8_t>(kColumns * kRows, 50),
                                                     std::vector<uint8_t>(kColumns * kRows, 90)};
  const DepthSelection choice = choose(flat(77), hypotheses, moments);
  EXPECT_EQ(choice.levels[5], 77);
  EXPECT_EQ(choice.levels[6], 90);
  std::vector<PhotoConsistency> nothing(2);
  for (PhotoConsistency& m : nothing) m.reset(kColumns, kRows);
  EXPECT_EQ(choose(flat(77), hypotheses, nothing).levels, flat(77).levels);
  EXPECT_TRUE(std::isnan(choose(flat(77), hypotheses, nothing).residual));
}

using Levels = std::vector<uint8_t>;

// Images of widely spaced cameras lack a near plane. The plane must not prevent other hypotheses from being compared.
TEST(DepthSelection, HypothesisWithFewNodesIsNotCompared) {
  const std::vector<Levels> hypotheses{Levels(kColumns * kRows, 50), Levels(kColumns * kRows, 90),
                                       Levels(kColumns * kRows, 200), Levels(kColumns * kRows, 250)};
  std::vector<PhotoConsistency> moments;
  for (const double sigma : {10., 4., 20., 1.}) moments.push_back(deviating([&](int, int) { return sigma; }));
  for (size_t i = 0; i < moments[2].weight.size(); i++) {
    if (i % kColumns > 2) moments[2].weight[i] = 0;
    moments[3].weight[i] = 0;
  }
  const DepthSelection choice = choose(flat(50), hypotheses, moments);
  EXPECT_NEAR(choice.energy[0], 100, 2);
  EXPECT_NEAR(choice.energy[1], 16, 1);
  EXPECT_NEAR(choice.cost[1], 4, 0.1);
  EXPECT_NEAR(choice.least_energy, 16, 1);
  for (const size_t t : {2, 3}) {
    EXPECT_TRUE(std::isnan(choice.cost[t])) << t;
    EXPECT_TRUE(std::isnan(choice.energy[t])) << t;
  }
  // A hypothesis is compared over the nodes that its cameras see, if they are most of the nodes.
  for (size_t i = 0; i < moments[2].weight.size(); i++)
    moments[2].weight[i] = i % kColumns > 8 ? 0 : PhotoConsistency::kWeightOne;
  EXPECT_NEAR(choose(flat(50), hypotheses, moments).cost[2], 20, 0.1);
}

// Sums of dark cameras with deviations far below a level: rounded to about 0.02.
PhotoConsistency nearly_agreeing(const auto& deviation) {
  PhotoConsistency moments;
  moments.reset(kColumns, kRows);
  for (size_t i = 0; i < moments.weight.size(); i++) {
    const double sigma = deviation(static_cast<int>(i) % kColumns, static_cast<int>(i) / kColumns);
    moments.weight[i] = PhotoConsistency::kWeightOne;
    moments.luma[i] = static_cast<uint16_t>(std::lround(PhotoConsistency::kLumaOne * std::sqrt(1 - sigma * sigma)));
    moments.square[i] = 1;
  }
  return moments;
}

TEST(DepthSelection, RoundingErrorsChangeNothing) {
  const std::vector<Levels> hypotheses{Levels(kColumns * kRows, 50), Levels(kColumns * kRows, 52)};
  const auto with = [&](const auto& deviation) {
    return choose(flat(50), hypotheses, {nearly_agreeing(deviation), nearly_agreeing([](int, int) { return 0; })})
        .levels;
  };
  EXPECT_EQ(with([](int, int) { return 0.2; }), hypotheses[0]) << "in all nodes";
  EXPECT_EQ(with([](int i, int j) { return i == 5 && j == 5 ? 0.2 : 0; }), hypotheses[0]) << "in one";
  EXPECT_EQ(with([](int, int) { return 0.4; }), hypotheses[1]) << "more than noise";
}

TEST(DepthSelection, OutlierFollowsItsNeighbours) {
  const std::vector<Levels> hypotheses{Levels(kColumns * kRows, 50), Levels(kColumns * kRows, 90)};
  const auto is_out = [](int i, int j) { return i == 6 && j == 4; };
  const std::vector<float> evidence(kColumns * kRows, 1);
  const auto with = [&](double better) {
    const std::vector<PhotoConsistency> moments{deviating([](int, int) { return 10; }),
                                                deviating([&](int i, int j) { return is_out(i, j) ? better : 20; })};
    const DepthSelectionParams terms{.evidence = evidence, .radius = 0};
    return select_depths(flat(50), hypotheses, moments, terms);
  };
  // Compared with eight neighbours, the lead requires gains of 0.6 and 0.25; isolation requires 4 and 0.1 more.
  const DepthSelection lone = with(6), sure = with(4);
  EXPECT_EQ(lone.levels, hypotheses[0]);
  EXPECT_EQ(lone.gained, 0);
  EXPECT_EQ(sure.levels[4 * kColumns + 6], 90) << "clear evidence keeps a single node";
  EXPECT_NEAR(sure.gained, 6. / (kColumns * kRows), 0.01);
}

TEST(DepthSelection, NodeWithoutEvidenceFollowsItsNeighbours) {
  const std::vector<Levels> hypotheses{Levels(kColumns * kRows, 50), Levels(kColumns * kRows, 90)};
  const auto is_untold = [](int i, int j) { return i >= 5 && i < 7 && j >= 4 && j < 6; };
  std::vector<float> evidence(kColumns * kRows, 1);
  for (size_t i = 0; i < evidence.size(); i++)
    if (is_untold(static_cast<int>(i) % kColumns, static_cast<int>(i) / kColumns)) evidence[i] = 0.2f;
  // At these nodes the cameras would seem to agree far better on the wrong surface.
  for (const int right : {0, 1}) {
    std::vector<PhotoConsistency> moments;
    for (const int hypothesis : {0, 1})
      moments.push_back(deviating([&](int i, int j) { return (hypothesis == right) != is_untold(i, j) ? 1 : 20; }));
    const DepthSelectionParams terms{.evidence = evidence, .radius = 0};
    const DepthSelection choice = select_depths(flat(50), hypotheses, moments, terms);
    EXPECT_EQ(choice.levels, hypotheses[static_cast<size_t>(right)]);
    EXPECT_EQ(choice.informed[4 * kColumns + 5], 0);
    EXPECT_EQ(choice.informed[0], 1);
    EXPECT_TRUE(std::isinf(choice.lead[4 * kColumns + 5]));
  }
}

TEST(DepthSelection, EqualDepthsAreNotInformed) {
  const auto informed = [](const std::vector<double>& deviations, float evidence) {
    std::vector<Levels> hypotheses;
    std::vector<PhotoConsistency> moments;
    for (size_t t = 0; t < deviations.size(); t++) {
      hypotheses.emplace_back(kColumns * kRows, static_cast<uint8_t>(50 + 10 * t));
      moments.push_back(deviating([&](int, int) { return deviations[t]; }));
    }
    return choose(flat(50), hypotheses, moments, std::vector<float>(kColumns * kRows, evidence)).informed[17] != 0;
  };
  EXPECT_TRUE(informed({2, 20}, 1));
  EXPECT_FALSE(informed({2, 20}, 0.3f)) << "too little evidence";
  EXPECT_FALSE(informed({8, 20}, 1)) << "cameras disagree either way";
  EXPECT_FALSE(informed({0, 1}, 1)) << "no texture";
  EXPECT_TRUE(informed({20, 20, 20, 10, 1, 1, 10, 20, 20}, 1)) << "planes beside each other";
  EXPECT_FALSE(informed({20, 20, 20, 1, 10, 20, 1, 20, 20}, 1)) << "a chance match among many";
}

// Bit-identical for maps of any size, for cameras that agree or not, and for impossible weights and sums.
TEST(DepthSelection, EqualsTheReferenceWithEveryInstructionSet) {
  reference::Random random(7);
  const auto below = [&](int end) { return static_cast<int>(random.uniform(0, end)); };
  const auto same = [](double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); };
  double informed = 0, changed = 0;
  for (int round = 0; round < 60; round++) {
    FocalMap map;
    map.columns = 1 + below(round % 2 ? 9 : 90);
    map.rows = 1 + below(20);
    const size_t nodes = static_cast<size_t>(map.columns) * map.rows;
    const size_t count = 1 + static_cast<size_t>(below(round % 3 ? 5 : kMaxHypotheses));
    map.levels.assign(nodes, 77);
    std::vector<float> evidence(nodes, 1);
    if (round % 2)
      for (float& of : evidence) of = static_cast<float>(random.uniform(0, 1));
    const double levels_a_pixel = round % 7 ? random.uniform(0, 30) : 8;
    std::vector<std::vector<uint8_t>> hypotheses;
    std::vector<PhotoConsistency> moments(count);
    const double missing = round % 3 == 0 ? 0 : random.uniform(0, 1), wild = round % 4 == 0 ? 0.2 : 0;
    for (size_t t = 0; t < count; t++) {
      hypotheses.emplace_back(nodes, static_cast<uint8_t>(t + 1));
      if (round % 4 == 1)
        for (uint8_t& level : hypotheses.back()) level = static_cast<uint8_t>(below(256));
      moments[t].reset(map.columns, map.rows);
      for (size_t i = 0; i < nodes; i++) {
        const double weight = random.uniform(0, 1) < missing ? random.uniform(0, 1) : 1, luma = random.uniform(0, 255);
        const double square = luma * luma + std::pow(below(round % 5 == 0 ? 1 : 30), 2);
        moments[t].weight[i] = static_cast<uint16_t>(weight * PhotoConsistency::kWeightOne);
        moments[t].luma[i] = static_cast<uint16_t>(weight * luma * PhotoConsistency::kLumaOne);
        moments[t].square[i] = static_cast<uint16_t>(std::min(weight * square, 65535.));
        for (std::vector<uint16_t>* sum : {&moments[t].weight, &moments[t].luma, &moments[t].square})
          if (random.uniform(0, 1) < wild) (*sum)[i] = static_cast<uint16_t>(below(4) == 0 ? 65535 : below(65536));
      }
    }
    std::vector<uint8_t> counted(round % 5 == 2 ? nodes : 0);
    for (uint8_t& counts : counted) counts = below(3) > 0;
    for (const int radius : {0, 1, 4}) {
      const DepthSelectionParams terms{
          .evidence = evidence, .counted = counted, .radius = radius, .levels_a_pixel = levels_a_pixel};
      const DepthSelection plain = test::plain_choice(map, hypotheses, moments, terms);
      informed += std::ranges::count(plain.informed, 1);
      changed += 1 - static_cast<double>(std::ranges::count(plain.chosen, 0)) / static_cast<double>(nodes);
      test::on_every_target([&] {
        const DepthSelection choice = select_depths(map, hypotheses, moments, terms);
        EXPECT_EQ(choice.levels, plain.levels);
        EXPECT_EQ(choice.chosen, plain.chosen);
        EXPECT_EQ(choice.least, plain.least);
        EXPECT_EQ(choice.lead, plain.lead);
        EXPECT_EQ(choice.informed, plain.informed);
        EXPECT_TRUE(same(choice.residual, plain.residual)) << choice.residual << ", " << plain.residual;
        EXPECT_TRUE(same(choice.gained, plain.gained)) << choice.gained << ", " << plain.gained;
        EXPECT_TRUE(same(choice.least_energy, plain.least_energy)) << choice.least_energy << ", " << plain.least_energy;
        EXPECT_TRUE(std::ranges::equal(choice.cost, plain.cost, same));
        EXPECT_TRUE(std::ranges::equal(choice.energy, plain.energy, same));
      });
    }
  }
  EXPECT_GT(informed, 100) << "otherwise nothing was compared";
  EXPECT_GT(changed, 10);
}

}  // namespace surface_choice_test
}  // namespace lf
