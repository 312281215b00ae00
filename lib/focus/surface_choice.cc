// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/surface_choice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "focus/moments.h"

namespace lf {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// In the order of the nodes, the same on every machine; four trials at a time, whose additions do not wait for each
// other.
void add_means(const std::vector<std::vector<float>>& costs, SurfaceChoice& choice) {
  const size_t nodes = costs[0].size(), last = costs.size() - 1;
  std::vector<float> most = costs[0];
  for (const std::vector<float>& cost : costs)
    for (size_t i = 0; i < nodes; i++) most[i] = std::max(most[i], cost[i]);
  const auto seen = std::ranges::count_if(most, [](float cost) { return cost < kInfinity; });
  choice.cost.assign(costs.size(), NAN);
  choice.energy.assign(costs.size(), NAN);
  choice.least_energy = NAN;
  if (seen == 0) return;
  const auto count = static_cast<double>(seen);
  for (size_t t = 0; t < costs.size(); t += 4) {
    const float* const of[4] = {costs[t].data(), costs[std::min(t + 1, last)].data(),
                                costs[std::min(t + 2, last)].data(), costs[std::min(t + 3, last)].data()};
    double sum[4] = {}, square[4] = {};
    for (size_t i = 0; i < nodes; i++) {
      if (!(most[i] < kInfinity)) continue;
      for (int k = 0; k < 4; k++) {
        sum[k] += of[k][i];
        square[k] += of[k][i] * of[k][i];
      }
    }
    for (size_t k = 0; k < 4 && t + k <= last; k++) {
      choice.cost[t + k] = sum[k] / count;
      choice.energy[t + k] = square[k] / count;
    }
  }
  double square = 0;
  for (size_t i = 0; i < nodes; i++)
    if (most[i] < kInfinity) square += choice.least[i] * choice.least[i];
  choice.least_energy = square / count;
}

// The median of deviations as three equal cameras would have them.
double residual_of(const std::vector<float>& deviations, std::span<const float> evidence) {
  std::vector<float> normalised(deviations.size());
  for (size_t i = 0; i < normalised.size(); i++)
    normalised[i] = evidence[i] < kLittleEvidence ? kInfinity : deviations[i] / evidence[i];
  return median_of_finite(normalised);
}

// The trials of a round, beside each other.
struct Round {
  const FocalMap& surface;
  const std::vector<std::vector<float>>& costs;
  std::vector<const uint8_t*> levels;
  const ChoiceTerms& terms;
  bool has_evidence(size_t node) const { return terms.evidence[node] >= kLittleEvidence; }
};

// Lets every node, one after the other, take the trial that is best beside what its neighbours have by then: iterated
// conditional modes (Besag 1986, "On the statistical analysis of dirty pictures"), with a cost of levels that grows up
// to a pixel of disparity.
void agree_with_neighbours(const Round& round, SurfaceChoice& choice) {
  constexpr int kPasses = 2;
  constexpr float kLeadWithoutEvidence = 0.05f;  // of the weight of all neighbours
  const int columns = round.surface.columns, rows = round.surface.rows;
  const auto apart = std::max(1.f, static_cast<float>(round.terms.levels_a_pixel));
  std::array<float, 256> step;  // of so many levels
  for (size_t d = 0; d < step.size(); d++) step[d] = std::min(static_cast<float>(d), apart);
  std::vector<uint8_t>& at = choice.levels;
  // Nodes whose neighbours have changed since their turn: the others would choose as they did.
  std::vector<uint8_t> is_due(at.size(), 1);
  for (int pass = 0; pass < kPasses; pass++)
    for (int y = 0; y < rows; y++)
      for (int x = 0; x < columns; x++) {
        const size_t i = static_cast<size_t>(y) * columns + x;
        if (!is_due[i] || !(choice.least[i] < kInfinity)) continue;
        is_due[i] = 0;
        size_t around[8];
        int count = 0;
        for (int v = std::max(y - 1, 0); v <= std::min(y + 1, rows - 1); v++)
          for (int u = std::max(x - 1, 0); u <= std::min(x + 1, columns - 1); u++)
            if (u != x || v != y) around[count++] = static_cast<size_t>(v) * columns + u;
        const bool evident = round.has_evidence(i);
        const float smooth =
            evident ? static_cast<float>(kSmooth * choice.residual) * round.terms.evidence[i] + kSmoothNoise : 1;
        const float weight = smooth / (apart * static_cast<float>(std::max(count, 1)));
        const auto steps_of = [&](size_t t) {
          float steps = 0;
          for (int k = 0; k < count; k++)
            steps += step[static_cast<size_t>(std::abs(round.levels[t][i] - at[around[k]]))];
          return weight * steps;
        };
        const auto cost_of = [&](size_t t, float steps) {
          return steps + (evident ? round.costs[t][i] : 0) +
                 (t == 0    ? 0
                  : evident ? choice.lead[i]
                            : kLeadWithoutEvidence);
        };
        // The first of those that cost least. Most nodes stay: others cost more already without their steps.
        size_t best = choice.chosen[i];
        float least = cost_of(best, steps_of(best));
        for (size_t t = 0; t < round.costs.size(); t++) {
          if (t == best || !(round.costs[t][i] < kInfinity) || cost_of(t, 0) > least) continue;
          const float cost = cost_of(t, steps_of(t));
          if (!(cost < least || (cost == least && t < best))) continue;
          least = cost;
          best = t;
        }
        if (round.levels[best][i] != at[i])
          for (int k = 0; k < count; k++) is_due[around[k]] = 1;
        choice.chosen[i] = static_cast<uint8_t>(best);
        at[i] = round.levels[best][i];
        choice.least[i] = round.costs[best][i];
      }
}

// Whether the choice of a node tells where something is.
bool is_informed(const Round& round, float least, size_t node) {
  if (round.terms.evidence[node] <= kToldEvidence) return false;
  const bool sweep = round.costs.size() >= kSweep;
  constexpr size_t kFirstPlane = 2;
  float most = 0, sum = 0;
  int count = 0;
  size_t best = 0;
  for (size_t t = 0; t < round.costs.size(); t++) {
    const float cost = round.costs[t][node];
    if (!(cost < kInfinity)) continue;
    most = std::max(most, cost);
    sum += cost;
    count++;
    if (t >= kFirstPlane && (best == 0 || cost < round.costs[best][node])) best = t;
  }
  const float wrong = sweep ? sum / static_cast<float>(count) : most;
  if (!(least + kTold < kTelling * wrong)) return false;
  for (size_t t = kFirstPlane; t < round.costs.size() && sweep; t++)
    if ((t + 1 < best || t > best + 1) && !(least + kTold < kUnique * round.costs[t][node])) return false;
  return true;
}

// By a power of two: scaled back, costs are what they were.
void scale_jumps(const ChoiceTerms& terms, float factor, std::vector<std::vector<float>>& costs) {
  for (size_t t = 1; t < costs.size(); t++)
    if (terms.jumps >> t & 1)
      for (float& cost : costs[t]) cost *= factor;
}

}  // namespace

SurfaceChoice choose_surface(const FocalMap& surface, std::span<const std::vector<uint8_t>> trials,
                             std::span<const Moments> moments, const ChoiceTerms& terms) {
  SurfaceChoice choice;
  choice.levels = surface.levels;
  std::vector<std::vector<float>> costs = trial_costs(moments.first(trials.size()), terms.radius);
  const std::vector<float>& base = costs[0];
  const size_t nodes = base.size();
  choice.residual = residual_of(base, terms.evidence);
  choice.chosen.assign(nodes, 0);
  choice.least.assign(nodes, kInfinity);
  choice.lead.assign(nodes, kInfinity);
  choice.informed.assign(nodes, 0);
  if (std::isnan(choice.residual)) return choice;
  Round round{surface, costs, {}, terms};
  for (const std::vector<uint8_t>& trial : trials) round.levels.push_back(trial.data());
  const auto lead = static_cast<float>(kLead * choice.residual);
  for (size_t i = 0; i < nodes; i++)
    if (round.has_evidence(i)) choice.lead[i] = lead * terms.evidence[i] + kNoise;
  scale_jumps(terms, kJump, costs);
  std::vector<float> best(nodes);
  cheapest_trials(costs, choice.lead, best.data(), choice.chosen.data());
  for (size_t i = 0; i < nodes; i++) {
    if (!(best[i] < kInfinity)) continue;
    choice.levels[i] = round.levels[choice.chosen[i]][i];
    choice.least[i] = costs[choice.chosen[i]][i];
  }
  agree_with_neighbours(round, choice);
  scale_jumps(terms, 1 / kJump, costs);
  double gained = 0;
  size_t seen = 0, changed = 0;
  for (size_t i = 0; i < nodes; i++) {
    if (!(choice.least[i] < kInfinity)) continue;
    choice.least[i] = costs[choice.chosen[i]][i];
    seen++;
    changed += choice.chosen[i] != 0;
    // Without jumps: which trial it is nothing foretells.
    gained += choice.chosen[i] != 0 && base[i] < kInfinity ? base[i] - choice.least[i] : 0.f;
    choice.informed[i] = is_informed(round, choice.least[i], i);
  }
  choice.gained = gained / static_cast<double>(seen);
  choice.changed = static_cast<double>(changed) / static_cast<double>(seen);
  add_means(costs, choice);
  return choice;
}

void DepthVotes::add(const FocalMap& map, const SurfaceChoice& choice) {
  std::array<double, 256> at_level{};
  for (size_t i = 0; i < map.levels.size(); i++) at_level[map.levels[i]] += choice.informed[i];
  for (double& votes : votes_) votes *= kFading;
  of_map_ = static_cast<double>(map.levels.size());
  nodes_ = kFading * nodes_ + of_map_;
  for (size_t level = 0; level < at_level.size(); level++) {
    const double bin = map.inverse_of(static_cast<double>(level)) / nearest_ * kBins;
    votes_[static_cast<size_t>(std::clamp(bin, 0., kBins - 1.))] += at_level[level];
  }
}

std::optional<DepthRange> DepthVotes::range() const {
  const double all = std::accumulate(votes_.begin(), votes_.end(), 0.), few = kOutliers * all;
  if (!(all > kFewVotes * nodes_)) return std::nullopt;
  const auto too_few = [&](int bin) {
    const double side = smallest_ * bin * nearest_ / kBins;
    return std::max(few, side * side * nodes_ / of_map_);
  };
  int first = 0, last = kBins - 1;
  for (double before = votes_[0]; before <= few && first < kBins - 1;) before += votes_[static_cast<size_t>(++first)];
  double nearer = votes_[kBins - 1];
  while (last > first && !(votes_[static_cast<size_t>(last)] > 0 && nearer > too_few(last)))
    nearer += votes_[static_cast<size_t>(--last)];
  return DepthRange{first * nearest_ / kBins, (last + 1) * nearest_ / kBins};
}

namespace {

constexpr int kMostLevel = static_cast<int>(FocalMap::kLevels);

}  // namespace

void set_range(const DepthRange& range, FocalMap& map) {
  std::array<uint8_t, kMostLevel + 1> level{};
  const FocalMap before = {.from = map.from, .farthest = map.farthest, .nearest = map.nearest, .levels = {}};
  map.farthest = range.farthest;
  map.nearest = range.nearest;
  for (int i = 0; i <= kMostLevel; i++) level[i] = map.level_of(before.inverse_of(i));
  for (uint8_t& at : map.levels) at = level[at];
}

}  // namespace lf
