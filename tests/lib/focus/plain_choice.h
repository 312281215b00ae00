// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "base/maths.h"
#include "focus/depth_selection.h"

// A plain reference implementation of select_depths(), one node at a time.
namespace lf::test {

inline std::vector<float> plain_cost(std::span<const PhotoConsistency> moments, size_t hypothesis, int radius) {
  const PhotoConsistency& of = moments[hypothesis];
  const int columns = of.columns, rows = of.rows;
  const size_t nodes = of.weight.size();
  std::vector<float> sum(nodes), count(nodes), row_sum(nodes), row_count(nodes), cost(nodes);
  for (size_t i = 0; i < nodes; i++) {
    int most = 0;
    for (const PhotoConsistency& m : moments) most = std::max<int>(most, m.weight[i]);
    const float deviation = of.deviation(i);
    const bool seen = !std::isnan(deviation) && of.weight[i] >= most - PhotoConsistency::kWeightOne / 16;
    sum[i] = seen ? deviation : 0;
    count[i] = seen ? 1 : 0;
  }
  const auto at = [&](int x, int y) { return static_cast<size_t>(y) * columns + x; };
  for (int y = 0; y < rows; y++)
    for (int x = 0; x < columns; x++)
      for (int k = std::max(x - radius, 0); k <= std::min(x + radius, columns - 1); k++) {
        const auto part = static_cast<float>(radius + 1 - std::abs(k - x));
        row_sum[at(x, y)] += part * sum[at(k, y)];
        row_count[at(x, y)] += part * count[at(k, y)];
      }
  for (int y = 0; y < rows; y++)
    for (int x = 0; x < columns; x++) {
      float total = 0, seen = 0;
      for (int k = std::max(y - radius, 0); k <= std::min(y + radius, rows - 1); k++) {
        const auto part = static_cast<float>(radius + 1 - std::abs(k - y));
        total += part * row_sum[at(x, k)];
        seen += part * row_count[at(x, k)];
      }
      const bool counts = seen > 0 && count[at(x, y)] > 0;
      cost[at(x, y)] = counts ? total / seen : std::numeric_limits<float>::infinity();
    }
  return cost;
}

inline double plain_median(std::vector<float> values) {
  std::erase_if(values, [](float v) { return !std::isfinite(v); });
  return values.empty() ? NAN : median(std::move(values));
}

// Costs of the hypotheses of a round, and all other inputs of the selection.
struct PlainRound {
  const FocalMap& surface;
  std::span<const std::vector<uint8_t>> hypotheses;
  const DepthSelectionParams& terms;
  std::vector<std::vector<float>> costs;
  double residual = NAN;

  bool has_evidence(size_t i) const { return terms.evidence[i] >= kLittleEvidence; }
  // Requires a normalised node.
  float lead(size_t i) const { return static_cast<float>(kLead * residual) * terms.evidence[i] + kNoise; }
};

// Returns the hypotheses with comparable means: all, if together they see half of the first hypothesis's nodes.
// Otherwise ordered by the overlap with the first, without hypotheses that would reduce the overlap below half.
inline std::vector<size_t> plain_compared(const std::vector<std::vector<float>>& costs,
                                          std::span<const uint8_t> counted) {
  const auto together = [&](const std::vector<size_t>& hypotheses) {
    int count = 0;
    for (size_t i = 0; i < costs[0].size(); i++)
      count += (counted.empty() || counted[i]) &&
               std::ranges::all_of(hypotheses, [&](size_t t) { return std::isfinite(costs[t][i]); });
    return count;
  };
  std::vector<size_t> all(costs.size());
  for (size_t t = 0; t < all.size(); t++) all[t] = t;
  const int half = together({0});
  if (2 * together(all) >= half) return all;
  std::stable_sort(all.begin() + 1, all.end(), [&](size_t a, size_t b) { return together({0, a}) > together({0, b}); });
  std::vector<size_t> compared{0};
  for (size_t k = 1; k < all.size(); k++) {
    compared.push_back(all[k]);
    if (2 * together(compared) < half) compared.pop_back();
  }
  return compared;
}

// Deviations scaled to three equal cameras.
inline double plain_residual(const PlainRound& round) {
  std::vector<float> normalised;
  for (size_t i = 0; i < round.costs[0].size(); i++)
    if (round.has_evidence(i)) normalised.push_back(round.costs[0][i] / round.terms.evidence[i]);
  return plain_median(normalised);
}

inline std::vector<int> plain_neighbours(const FocalMap& map, const std::vector<uint8_t>& levels, size_t node) {
  const int x = static_cast<int>(node) % map.columns, y = static_cast<int>(node) / map.columns;
  std::vector<int> around;
  for (int v = y - 1; v <= y + 1; v++)
    for (int u = x - 1; u <= x + 1; u++)
      if ((u != x || v != y) && u >= 0 && v >= 0 && u < map.columns && v < map.rows)
        around.push_back(levels[static_cast<size_t>(v) * map.columns + u]);
  return around;
}

// Returns a hypothesis's cost with neighbours: the distance to the neighbours' levels, up to a pixel each, plus the
// node's own cost if it has evidence.
inline float plain_cost_beside(const PlainRound& round, size_t node, size_t hypothesis,
                               const std::vector<int>& around) {
  const bool evident = round.has_evidence(node);
  const auto pixel = std::max(1.f, static_cast<float>(round.terms.levels_a_pixel));
  const float of_one_apart =
      evident ? static_cast<float>(kSmooth * round.residual) * round.terms.evidence[node] + kSmoothNoise : 1;
  float apart = 0;
  for (const int level : around)
    apart += std::min(static_cast<float>(std::abs(round.hypotheses[hypothesis][node] - level)), pixel);
  const float lead = hypothesis == 0 ? 0 : evident ? round.lead(node) : 0.05f;
  const auto neighbours = static_cast<float>(std::max<size_t>(around.size(), 1));
  return of_one_apart / (pixel * neighbours) * apart + (evident ? round.costs[hypothesis][node] : 0) + lead;
}

inline bool plain_informed(const PlainRound& round, size_t node, float least) {
  if (!std::isfinite(least) || !(round.terms.evidence[node] > kMinEvidence)) return false;
  if (!round.terms.counted.empty() && !round.terms.counted[node]) return false;
  std::vector<float> seen;
  for (const std::vector<float>& cost : round.costs)
    if (std::isfinite(cost[node])) seen.push_back(cost[node]);
  const bool sweep = round.costs.size() >= kSweep;
  float mean = 0;
  for (const float cost : seen) mean += cost;
  mean /= static_cast<float>(seen.size());
  if (!(least + kLumaNoise < kMaxDeviationRatio * (sweep ? mean : std::ranges::max(seen)))) return false;
  if (!sweep) return true;
  std::vector<float> planes;
  for (size_t t = 2; t < round.costs.size(); t++) planes.push_back(round.costs[t][node]);
  const auto best = std::ranges::min_element(planes) - planes.begin();
  const bool any = std::isfinite(planes[static_cast<size_t>(best)]);
  for (std::ptrdiff_t p = 0; p < std::ssize(planes); p++) {
    const bool beside = any && std::abs(p - best) <= 1;
    if (!beside && !(least + kLumaNoise < kUnique * planes[static_cast<size_t>(p)])) return false;
  }
  return true;
}

inline DepthSelection plain_choice(const FocalMap& surface, std::span<const std::vector<uint8_t>> hypotheses,
                                   std::span<const PhotoConsistency> moments, const DepthSelectionParams& terms) {
  PlainRound round{surface, hypotheses, terms, {}};
  for (size_t t = 0; t < hypotheses.size(); t++) round.costs.push_back(plain_cost(moments, t, terms.radius));
  const std::vector<std::vector<float>>& costs = round.costs;
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const size_t nodes = costs[0].size();
  DepthSelection choice;
  choice.levels = surface.levels;
  choice.chosen.assign(nodes, 0);
  choice.least.assign(nodes, kInfinity);
  choice.lead.assign(nodes, kInfinity);
  choice.informed.assign(nodes, 0);
  choice.residual = round.residual = plain_residual(round);
  if (std::isnan(choice.residual)) return choice;

  for (size_t i = 0; i < nodes; i++) {
    if (round.has_evidence(i)) choice.lead[i] = round.lead(i);
    float best = costs[0][i];
    for (size_t t = 1; t < hypotheses.size() && round.has_evidence(i); t++)
      if (costs[t][i] + choice.lead[i] < best) {
        best = costs[t][i] + choice.lead[i];
        choice.chosen[i] = static_cast<uint8_t>(t);
      }
    if (!std::isfinite(best)) continue;
    choice.least[i] = costs[choice.chosen[i]][i];
    choice.levels[i] = hypotheses[choice.chosen[i]][i];
  }
  // Two passes with neighbours, one node after another.
  for (size_t step = 0; step < 2 * nodes; step++) {
    const size_t i = step % nodes;
    if (!std::isfinite(choice.least[i])) continue;
    const std::vector<int> around = plain_neighbours(surface, choice.levels, i);
    float best = kInfinity;
    for (size_t t = 0; t < hypotheses.size(); t++) {
      if (!std::isfinite(costs[t][i])) continue;
      const float cost = plain_cost_beside(round, i, t, around);
      if (cost < best) choice.chosen[i] = static_cast<uint8_t>(t);
      best = std::min(best, cost);
    }
    choice.least[i] = costs[choice.chosen[i]][i];
    choice.levels[i] = hypotheses[choice.chosen[i]][i];
  }

  double seen = 0, in_all = 0;
  choice.cost.assign(hypotheses.size(), 0);
  choice.energy.assign(hypotheses.size(), 0);
  const std::vector<size_t> compared = plain_compared(costs, terms.counted);
  for (size_t i = 0; i < nodes; i++) {
    if ((terms.counted.empty() || terms.counted[i]) &&
        std::ranges::all_of(compared, [&](size_t t) { return std::isfinite(costs[t][i]); })) {
      in_all++;
      for (size_t t = 0; t < hypotheses.size(); t++) {
        choice.cost[t] += costs[t][i];
        choice.energy[t] += costs[t][i] * costs[t][i];
      }
      choice.least_energy += choice.least[i] * choice.least[i];
    }
    if (!std::isfinite(choice.least[i])) continue;
    seen++;
    if (choice.chosen[i] != 0 && std::isfinite(costs[0][i])) choice.gained += costs[0][i] - choice.least[i];
    choice.informed[i] = plain_informed(round, i, choice.least[i]);
  }
  choice.least_energy = in_all > 0 ? choice.least_energy / in_all : NAN;
  for (size_t t = 0; t < hypotheses.size(); t++) {
    const bool known = in_all > 0 && std::ranges::find(compared, t) != compared.end();
    for (double* mean : {&choice.cost[t], &choice.energy[t]}) *mean = known ? *mean / in_all : NAN;
  }
  choice.gained /= seen;
  return choice;
}

}  // namespace lf::test
