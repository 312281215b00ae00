// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/depth_votes.h"

#include <algorithm>
#include <array>
#include <numeric>

namespace lf {
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
