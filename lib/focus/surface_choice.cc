// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/surface_choice.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/median.h"

namespace lf {
namespace {

constexpr int kMissingWeight = Moments::kWeightOne / 16;

// The most weight that any trial has at each node, less what may be missing: fewer cameras always agree better.
std::vector<uint16_t> least_weights(std::span<const Moments> moments) {
  std::vector<uint16_t> least(moments[0].weight.size());
  for (const Moments& m : moments)
    for (size_t i = 0; i < least.size(); i++) least[i] = std::max(least[i], m.weight[i]);
  for (uint16_t& w : least) w = static_cast<uint16_t>(std::max(w - kMissingWeight, 0));
  return least;
}

// Means over `radius` nodes around of the deviations there are, farther ones with less weight (a tent: edges stay where
// they are better than in a box); infinity where there is none, or less weight than `least`.
std::vector<float> smoothed_cost(const Moments& moments, const std::vector<uint16_t>& least, int radius) {
  const int columns = moments.columns, rows = moments.rows;
  const size_t nodes = moments.weight.size();
  std::vector<float> sum(nodes), count(nodes), row_sum(nodes), row_count(nodes);
  for (size_t i = 0; i < nodes; i++) {
    const float deviation = moments.deviation(i);
    const bool seen = !std::isnan(deviation) && moments.weight[i] >= least[i];
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
  std::vector<float> cost(nodes);
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

double median_of_finite(std::vector<float> values) {
  std::erase_if(values, [](float v) { return !std::isfinite(v); });
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  return median(std::move(values));
}

std::vector<double> mean_costs(const std::vector<std::vector<float>>& costs) {
  std::vector<double> means(costs.size());
  size_t seen = 0;
  for (size_t i = 0; i < costs[0].size(); i++) {
    if (!std::ranges::all_of(costs, [i](const std::vector<float>& c) { return std::isfinite(c[i]); })) continue;
    seen++;
    for (size_t t = 0; t < costs.size(); t++) means[t] += costs[t][i];
  }
  for (double& mean : means) mean = seen > 0 ? mean / static_cast<double>(seen) : NAN;
  return means;
}

}  // namespace

SurfaceChoice choose_surface(const FocalMap& surface, std::span<const std::vector<uint8_t>> trials,
                             std::span<const Moments> moments, int radius) {
  SurfaceChoice choice;
  choice.levels = surface.levels;
  const std::vector<uint16_t> least = least_weights(moments);
  std::vector<float> best = smoothed_cost(moments[0], least, radius);
  const std::vector<float> base = best;
  choice.residual = median_of_finite(base);
  if (std::isnan(choice.residual)) return choice;
  const auto lead = static_cast<float>(kLead * choice.residual);
  std::vector<size_t> chosen(best.size(), 0);
  std::vector<std::vector<float>> costs{base};
  for (size_t t = 1; t < trials.size(); t++) {
    costs.push_back(smoothed_cost(moments[t], least, radius));
    const std::vector<float>& cost = costs.back();
    for (size_t i = 0; i < best.size(); i++)
      if (cost[i] + lead < best[i]) {
        best[i] = cost[i] + lead;
        chosen[i] = t;
      }
  }
  choice.cost = mean_costs(costs);
  size_t seen = 0, changed = 0;
  for (size_t i = 0; i < best.size(); i++) {
    if (!std::isfinite(best[i])) continue;
    choice.levels[i] = trials[chosen[i]][i];
    seen++;
    changed += chosen[i] != 0;
    if (chosen[i] != 0 && std::isfinite(base[i])) choice.gained += base[i] - (best[i] - lead);
  }
  choice.gained /= static_cast<double>(seen);
  choice.changed = static_cast<double>(changed) / static_cast<double>(seen);
  return choice;
}

}  // namespace lf
