// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/depth_votes.h"

#include <algorithm>
#include <numeric>

namespace lf {

void DepthVotes::add(const FocalMap& map, const SurfaceChoice& choice) {
  std::array<double, 256> at_level{};
  for (size_t i = 0; i < map.levels.size(); i++) at_level[map.levels[i]] += choice.informed[i];
  for (double& votes : votes_) votes *= kFading;
  nodes_ = kFading * nodes_ + static_cast<double>(map.levels.size());
  for (size_t level = 0; level < at_level.size(); level++) {
    const double bin = map.inverse_of(static_cast<double>(level)) / nearest_ * kBins;
    votes_[static_cast<size_t>(std::clamp(bin, 0., kBins - 1.))] += at_level[level];
  }
}

std::optional<DepthRange> DepthVotes::range() const {
  const double all = std::accumulate(votes_.begin(), votes_.end(), 0.), few = kOutliers * all;
  if (!(all > kFewVotes * nodes_)) return std::nullopt;
  int first = 0, last = kBins - 1;
  for (double before = votes_[0]; before <= few && first < kBins - 1;) before += votes_[static_cast<size_t>(++first)];
  for (double beyond = votes_[kBins - 1]; beyond <= few && last > first;) beyond += votes_[static_cast<size_t>(--last)];
  return DepthRange{first * nearest_ / kBins, (last + 1) * nearest_ / kBins};
}

}  // namespace lf
