// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/median.h"
#include "focus/surface_choice.h"

// choose_surface() a node after the other, as its comments say it.
namespace lf::test {

inline std::vector<float> plain_cost(std::span<const Moments> moments, size_t trial, int radius) {
  const Moments& of = moments[trial];
  const int columns = of.columns, rows = of.rows;
  const size_t nodes = of.weight.size();
  std::vector<float> sum(nodes), count(nodes), row_sum(nodes), row_count(nodes), cost(nodes);
  for (size_t i = 0; i < nodes; i++) {
    int most = 0;
    for (const Moments& m : moments) most = std::max<int>(most, m.weight[i]);
    const float deviation = of.deviation(i);
    const bool seen = !std::isnan(deviation) && of.weight[i] >= most - Moments::kWeightOne / 16;
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

inline SurfaceChoice plain_choice(const FocalMap& surface, std::span<const std::vector<uint8_t>> trials,
                                  std::span<const Moments> moments, int radius) {
  SurfaceChoice choice;
  choice.levels = surface.levels;
  std::vector<std::vector<float>> costs;
  for (size_t t = 0; t < trials.size(); t++) costs.push_back(plain_cost(moments, t, radius));
  const std::vector<float>& base = costs[0];
  choice.residual = plain_median(base);
  if (std::isnan(choice.residual)) return choice;
  const auto lead = static_cast<float>(kLead * choice.residual);
  choice.cost.assign(trials.size(), 0);
  double in_all = 0, seen = 0;
  for (size_t i = 0; i < base.size(); i++) {
    float best = base[i];
    size_t chosen = 0;
    bool by_all = std::isfinite(base[i]);
    for (size_t t = 1; t < trials.size(); t++) {
      by_all = by_all && std::isfinite(costs[t][i]);
      if (costs[t][i] + lead < best) {
        best = costs[t][i] + lead;
        chosen = t;
      }
    }
    if (by_all) {
      in_all++;
      for (size_t t = 0; t < trials.size(); t++) choice.cost[t] += costs[t][i];
    }
    if (!std::isfinite(best)) continue;
    seen++;
    choice.levels[i] = trials[chosen][i];
    choice.changed += chosen != 0;
    if (chosen != 0 && std::isfinite(base[i])) choice.gained += base[i] - (best - lead);
  }
  for (double& mean : choice.cost) mean = in_all > 0 ? mean / in_all : NAN;
  choice.gained /= seen;
  choice.changed /= seen;
  return choice;
}

}  // namespace lf::test
