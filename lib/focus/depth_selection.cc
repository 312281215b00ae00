// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/depth_selection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/maths.h"
#include "focus/photo_consistency.h"

namespace lf {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// The hypotheses that are compared by their mean costs, and the largest of their costs at each node. The cost is
// infinite if one of them does not see the node.
struct Compared {
  std::vector<bool> hypothesis;
  std::vector<float> most;
};

// Selects the hypotheses to compare. Means can only be compared over the same nodes. A hypothesis that sees few of the
// surface's nodes would leave too few common nodes, for example a near plane if cameras are far apart. Hypotheses are
// therefore added in descending order of the nodes that they share with the surface, as long as the fraction kCompared
// of the surface's nodes remains.
Compared compared_hypotheses(const std::vector<std::vector<float>>& costs, std::span<const uint8_t> counted) {
  constexpr double kCompared = 0.5;
  const auto num_seen = [](const std::vector<float>& most) {
    return std::ranges::count_if(most, [](float cost) { return cost < kInfinity; });
  };
  const auto raise_to = [](const std::vector<float>& cost, std::vector<float>& most) {
    for (size_t i = 0; i < most.size(); i++) most[i] = std::max(most[i], cost[i]);
  };
  std::vector<float> base = costs[0];
  for (size_t i = 0; i < counted.size(); i++)
    if (!counted[i]) base[i] = kInfinity;
  Compared compared{std::vector<bool>(costs.size(), true), base};
  const auto least = kCompared * static_cast<double>(num_seen(base));
  for (const std::vector<float>& cost : costs) raise_to(cost, compared.most);
  if (static_cast<double>(num_seen(compared.most)) >= least) return compared;  // usual case
  std::vector<std::pair<ptrdiff_t, size_t>> order;
  std::vector<float> most;
  const auto shared_by = [&](const std::vector<float>& before, size_t t) {
    most = before;
    raise_to(costs[t], most);
    return num_seen(most);
  };
  for (size_t t = 1; t < costs.size(); t++) order.emplace_back(-shared_by(base, t), t);
  std::ranges::sort(order);
  compared.most = base;
  for (const auto& [shared, t] : order) {
    compared.hypothesis[t] = static_cast<double>(shared_by(compared.most, t)) >= least;
    if (compared.hypothesis[t]) compared.most = most;
  }
  return compared;
}

// Computes the means of DepthSelection. Adds in the order of the nodes, so that the result is the same on every
// machine.
void add_means(const std::vector<std::vector<float>>& costs, std::span<const uint8_t> counted, DepthSelection& choice) {
  const size_t nodes = costs[0].size(), last = costs.size() - 1;
  const auto [is_compared, most] = compared_hypotheses(costs, counted);
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
      if (!is_compared[t + k]) continue;
      choice.cost[t + k] = sum[k] / count;
      choice.energy[t + k] = square[k] / count;
    }
  }
  double square = 0;
  for (size_t i = 0; i < nodes; i++)
    if (most[i] < kInfinity) square += choice.least[i] * choice.least[i];
  choice.least_energy = square / count;
}

// Returns the median of the deviations, normalised as if three cameras with equal weights contributed to each node.
double residual_of(const std::vector<float>& deviations, std::span<const float> evidence) {
  std::vector<float> normalised(deviations.size());
  for (size_t i = 0; i < normalised.size(); i++)
    normalised[i] = evidence[i] < kLittleEvidence ? kInfinity : deviations[i] / evidence[i];
  return median_of_finite(normalised);
}

struct Round {
  const FocalMap& surface;
  const std::vector<std::vector<float>>& costs;
  std::vector<const uint8_t*> levels;
  const DepthSelectionParams& terms;
  bool has_evidence(size_t node) const { return terms.evidence[node] >= kLittleEvidence; }
};

// Makes neighbouring nodes agree: in turn, each node takes the best hypothesis given the levels of its neighbours. This
// is the method of iterated conditional modes (Besag 1986, "On the statistical analysis of dirty pictures"). The cost
// of a level difference grows up to one pixel of disparity and then stays the same, so that depth edges remain
// possible.
void agree_with_neighbours(const Round& round, DepthSelection& choice) {
  constexpr int kPasses = 2;
  constexpr float kLeadWithoutEvidence = 0.05f;  // part of the weight of all neighbours
  const int columns = round.surface.columns, rows = round.surface.rows;
  const auto apart = std::max(1.f, static_cast<float>(round.terms.levels_a_pixel));
  std::array<float, 256> step;  // cost of each level difference
  for (size_t d = 0; d < step.size(); d++) step[d] = std::min(static_cast<float>(d), apart);
  std::vector<uint8_t>& at = choice.levels;
  // 1 for nodes with a neighbour that has changed since their last turn. All other nodes would make the same choice
  // again.
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
        // The first hypothesis wins a tie. Most hypotheses already cost too much without the neighbours' term.
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

// Returns true if the selected level of a node is reliable; see kMaxDeviationRatio. `least` is its deviation.
bool is_informed(const Round& round, float least, size_t node) {
  if (round.terms.evidence[node] <= kMinEvidence) return false;
  if (!round.terms.counted.empty() && !round.terms.counted[node]) return false;
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
  if (!(least + kLumaNoise < kMaxDeviationRatio * wrong)) return false;
  for (size_t t = kFirstPlane; t < round.costs.size() && sweep; t++)
    if ((t + 1 < best || t > best + 1) && !(least + kLumaNoise < kUnique * round.costs[t][node])) return false;
  return true;
}

// Multiplies the costs of jumps (see kJump). A power of two as factor ensures that scaling back restores the exact
// costs.
void scale_jumps(const DepthSelectionParams& terms, float factor, std::vector<std::vector<float>>& costs) {
  for (size_t t = 1; t < costs.size(); t++)
    if (terms.jumps >> t & 1)
      for (float& cost : costs[t]) cost *= factor;
}

}  // namespace

DepthSelection select_depths(const FocalMap& surface, std::span<const std::vector<uint8_t>> hypotheses,
                             std::span<const PhotoConsistency> moments, const DepthSelectionParams& terms) {
  DepthSelection choice;
  choice.levels = surface.levels;
  std::vector<std::vector<float>> costs = hypothesis_costs(moments.first(hypotheses.size()), terms.radius);
  const std::vector<float>& base = costs[0];
  const size_t nodes = base.size();
  choice.residual = residual_of(base, terms.evidence);
  choice.chosen.assign(nodes, 0);
  choice.least.assign(nodes, kInfinity);
  choice.lead.assign(nodes, kInfinity);
  choice.informed.assign(nodes, 0);
  if (std::isnan(choice.residual)) return choice;
  Round round{surface, costs, {}, terms};
  for (const std::vector<uint8_t>& hypothesis : hypotheses) round.levels.push_back(hypothesis.data());
  const auto lead = static_cast<float>(kLead * choice.residual);
  for (size_t i = 0; i < nodes; i++)
    if (round.has_evidence(i)) choice.lead[i] = lead * terms.evidence[i] + kNoise;
  scale_jumps(terms, kJump, costs);
  std::vector<float> best(nodes);
  cheapest_hypotheses(costs, choice.lead, best.data(), choice.chosen.data());
  for (size_t i = 0; i < nodes; i++) {
    if (!(best[i] < kInfinity)) continue;
    choice.levels[i] = round.levels[choice.chosen[i]][i];
    choice.least[i] = costs[choice.chosen[i]][i];
  }
  agree_with_neighbours(round, choice);
  scale_jumps(terms, 1 / kJump, costs);
  double gained = 0;
  size_t seen = 0;
  for (size_t i = 0; i < nodes; i++) {
    if (!(choice.least[i] < kInfinity)) continue;
    choice.least[i] = costs[choice.chosen[i]][i];
    seen++;
    // A conditional expression instead of a branch, because branch prediction would often fail here.
    gained += choice.chosen[i] != 0 && base[i] < kInfinity ? base[i] - choice.least[i] : 0.f;
    choice.informed[i] = is_informed(round, choice.least[i], i);
  }
  choice.gained = gained / static_cast<double>(seen);
  add_means(costs, terms.counted, choice);
  choice.costs = std::move(costs);
  return choice;
}

namespace {

// A summed-area table, which counts marked nodes in any rectangle of a map in constant time.
class NodeCounts {
 public:
  NodeCounts(const FocalMap& map, const auto& counts)
      : stride_(map.columns + 1), sums_(static_cast<size_t>(stride_) * (static_cast<size_t>(map.rows) + 1)) {
    for (int y = 0; y < map.rows; y++) {
      uint32_t row = 0;
      for (int x = 0; x < map.columns; x++) {
        row += counts(static_cast<size_t>(y) * map.columns + x);
        sums_[at(x + 1, y + 1)] = sums_[at(x + 1, y)] + row;
      }
    }
  }
  uint32_t within(const Rect& nodes) const {
    return sums_[at(nodes.x1, nodes.y1)] - sums_[at(nodes.x0, nodes.y1)] - sums_[at(nodes.x1, nodes.y0)] +
           sums_[at(nodes.x0, nodes.y0)];
  }

 private:
  size_t at(int x, int y) const { return static_cast<size_t>(y) * stride_ + x; }
  int stride_;
  std::vector<uint32_t> sums_;
};

}  // namespace

// Returns the votes without nodes that may appear near by chance only. The cameras of several triangles see a truly
// near object, so they agree in a whole window of nodes, as wide as a cell of the array at that depth.
std::vector<uint8_t> DepthVotes::consistent(const FocalMap& map, const std::vector<uint8_t>& informed) const {
  constexpr double kMinSide = 2;      // nodes; a smaller window has no neighbours
  constexpr double kSameDepth = 1.2;  // ratio of inverse distances
  constexpr uint32_t kAgreeing = 8;   // one of so many votes in the window must be for the same depth
  constexpr int kNoWindow = -10;      // a bin without neighbours
  std::array<int, 256> bin;           // by level
  for (int level = 0; level < 256; level++) {
    const double side = smallest_ * map.inverse_of(level);
    bin[level] = side < kMinSide ? kNoWindow : static_cast<int>(std::log(side) / std::log(kSameDepth));
  }
  std::array<bool, 256> is_voted{};
  for (size_t i = 0; i < informed.size(); i++) is_voted[map.levels[i]] |= informed[i] != 0;
  std::vector<uint8_t> votes(informed);
  std::optional<NodeCounts> all;
  for (int level = 0; level < 256;) {
    const int here = bin[level];
    bool any = false;
    for (; level < 256 && bin[level] == here; level++) any |= is_voted[level];
    if (here == kNoWindow || !any) continue;
    const auto is_same = [&](size_t node) { return informed[node] && std::abs(bin[map.levels[node]] - here) <= 1; };
    const NodeCounts same(map, is_same);
    if (!all) all.emplace(map, [&](size_t node) { return informed[node]; });
    for (int y = 0; y < map.rows; y++)
      for (int x = 0; x < map.columns; x++) {
        const size_t node = static_cast<size_t>(y) * map.columns + x;
        if (!informed[node] || bin[map.levels[node]] != here) continue;
        const int half = static_cast<int>(smallest_ * map.inverse_of(map.levels[node]) / 2);
        const Rect window = intersect({x - half, y - half, x + half + 1, y + half + 1}, {0, 0, map.columns, map.rows});
        if (kAgreeing * same.within(window) < all->within(window)) votes[node] = 0;
      }
  }
  return votes;
}

void DepthVotes::add(const FocalMap& map, const DepthSelection& choice) {
  // Planes over the whole range belong to searches and sweeps.
  const std::vector<uint8_t> votes = choice.cost.size() >= kSweep ? consistent(map, choice.informed) : choice.informed;
  std::array<double, 256> at_level{};
  for (size_t i = 0; i < map.levels.size(); i++) at_level[map.levels[i]] += votes[i];
  for (double& before : votes_) before *= kFading;
  const auto seen = std::ranges::count_if(choice.least, [](float least) { return least < kInfinity; });
  rounds_ = kFading * rounds_ + 1;
  seen_ = kFading * seen_ + static_cast<double>(seen);
  for (size_t level = 0; level < at_level.size(); level++) {
    const double bin = map.inverse_of(static_cast<double>(level)) / nearest_ * kBins;
    votes_[static_cast<size_t>(std::clamp(bin, 0., kBins - 1.))] += at_level[level];
  }
}

std::optional<DepthRange> DepthVotes::range() const {
  const double all = std::accumulate(votes_.begin(), votes_.end(), 0.), few = kOutliers * all;
  if (!(all > kFewVotes * seen_)) return std::nullopt;
  const auto too_few = [&](int bin) {
    const double side = smallest_ * bin * nearest_ / kBins;
    return std::max(few, side * side * rounds_);
  };
  int first = 0, last = kBins - 1;
  for (double before = votes_[0]; before <= few && first < kBins - 1;) before += votes_[static_cast<size_t>(++first)];
  double nearer = votes_[kBins - 1];
  while (last > first && !(votes_[static_cast<size_t>(last)] > 0 && nearer > too_few(last)))
    nearer += votes_[static_cast<size_t>(--last)];
  return DepthRange{first * nearest_ / kBins, (last + 1) * nearest_ / kBins};
}

namespace {

constexpr int kMaxLevel = static_cast<int>(FocalMap::kLevels);

}  // namespace

void set_range(const DepthRange& range, FocalMap& map) {
  std::array<uint8_t, kMaxLevel + 1> level{};
  const FocalMap before = {.from = map.from, .farthest = map.farthest, .nearest = map.nearest, .levels = {}};
  map.farthest = range.farthest;
  map.nearest = range.nearest;
  for (int i = 0; i <= kMaxLevel; i++) level[i] = map.level_of(before.inverse_of(i));
  for (uint8_t& at : map.levels) at = level[at];
}

}  // namespace lf
