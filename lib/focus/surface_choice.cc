// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/surface_choice.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "focus/trial_cost.h"

namespace lf {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// In the order of the nodes, the same on every machine; four trials at a time, whose additions do not wait for each
// other.
std::vector<double> mean_costs(const std::vector<std::vector<float>>& costs) {
  const size_t nodes = costs[0].size(), last = costs.size() - 1;
  std::vector<float> most = costs[0];
  for (const std::vector<float>& cost : costs)
    for (size_t i = 0; i < nodes; i++) most[i] = std::max(most[i], cost[i]);
  const auto seen = std::ranges::count_if(most, [](float cost) { return cost < kInfinity; });
  std::vector<double> means(costs.size(), NAN);
  for (size_t t = 0; t < costs.size() && seen > 0; t += 4) {
    const float* const of[4] = {costs[t].data(), costs[std::min(t + 1, last)].data(),
                                costs[std::min(t + 2, last)].data(), costs[std::min(t + 3, last)].data()};
    double sum[4] = {};
    for (size_t i = 0; i < nodes; i++) {
      if (!(most[i] < kInfinity)) continue;
      for (int k = 0; k < 4; k++) sum[k] += of[k][i];
    }
    for (size_t k = 0; k < 4 && t + k <= last; k++) means[t + k] = sum[k] / static_cast<double>(seen);
  }
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
  std::vector<uint8_t>& chosen = choice.chosen;
  chosen.assign(base.size(), 0);
  choice.least.assign(base.size(), kInfinity);
  if (std::isnan(choice.residual)) return choice;
  const float lead = choice.lead = static_cast<float>(kLead * choice.residual);
  std::vector<float> best(base.size());
  cheapest_trials(costs, lead, best.data(), chosen.data());
  choice.cost = mean_costs(costs);
  std::vector<const uint8_t*> levels;
  for (const std::vector<uint8_t>& trial : trials) levels.push_back(trial.data());
  double gained = 0;
  size_t seen = 0, changed = 0;
  for (size_t i = 0; i < best.size(); i++) {
    if (!(best[i] < kInfinity)) continue;
    choice.levels[i] = levels[chosen[i]][i];
    choice.least[i] = best[i] - (chosen[i] != 0 ? lead : 0.f);
    seen++;
    changed += chosen[i] != 0;
    const float less = base[i] - (best[i] - lead);
    gained += chosen[i] != 0 && base[i] < kInfinity ? less : 0.0;  // no jumps: which it is nothing foretells
  }
  choice.gained = gained / static_cast<double>(seen);
  choice.changed = static_cast<double>(changed) / static_cast<double>(seen);
  return choice;
}

}  // namespace lf
