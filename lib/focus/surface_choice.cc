// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/surface_choice.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "focus/trial_cost.h"

namespace lf {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// The sums are in the order of the nodes: the same on every machine.
std::vector<double> mean_costs(const std::vector<std::vector<float>>& costs) {
  std::vector<double> means(costs.size());
  size_t seen = 0;
  for (size_t i = 0; i < costs[0].size(); i++) {
    if (!std::ranges::all_of(costs, [i](const std::vector<float>& c) { return c[i] < kInfinity; })) continue;
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
  const std::vector<std::vector<float>> costs = trial_costs(moments.first(trials.size()), radius);
  const std::vector<float>& base = costs[0];
  choice.residual = median_of_finite(base);
  if (std::isnan(choice.residual)) return choice;
  const auto lead = static_cast<float>(kLead * choice.residual);
  std::vector<float> best(base.size());
  std::vector<uint8_t> chosen(base.size());
  cheapest_trials(costs, lead, best.data(), chosen.data());
  choice.cost = mean_costs(costs);
  size_t seen = 0, changed = 0;
  for (size_t i = 0; i < best.size(); i++) {
    if (!(best[i] < kInfinity)) continue;
    choice.levels[i] = trials[chosen[i]][i];
    seen++;
    changed += chosen[i] != 0;
    if (chosen[i] != 0 && base[i] < kInfinity) choice.gained += base[i] - (best[i] - lead);
  }
  choice.gained /= static_cast<double>(seen);
  choice.changed = static_cast<double>(changed) / static_cast<double>(seen);
  return choice;
}

}  // namespace lf
