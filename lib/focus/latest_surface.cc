// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/latest_surface.h"

#include <algorithm>
#include <limits>

#include "focus/carry_over.h"
#include "focus/depth_votes.h"

namespace lf {

void LatestSurface::leaves(const std::vector<Trial>& trials) {
  underway_.push_back({trials, rounds_});
  if (underway_.size() > kMostUnderway) underway_.pop_front();
}

std::shared_ptr<const FocalMap> LatestSurface::seen_from(const View& view) const {
  return view_.focus.map ? carry_over(view_, view) : nullptr;
}

void LatestSurface::merge(const ViewRequest& request, const SurfaceChoice& choice, FocalMap& map) {
  // Requests keep their order; those before this one that were not answered are lost.
  const auto left = std::ranges::find(underway_, request.trials, &Underway::trials);
  const unsigned known = left == underway_.end() ? rounds_ : left->rounds;
  if (left != underway_.end()) underway_.erase(underway_.begin(), left + 1);
  std::shared_ptr<const FocalMap> before;
  if (known < rounds_) before = seen_from(request.view);
  if (before && (before->farthest != map.farthest || before->nearest != map.nearest)) {
    auto same_range = std::make_shared<FocalMap>(*before);
    set_range({map.farthest, map.nearest}, *same_range);
    before = std::move(same_range);
  }
  rounds_++;
  const size_t nodes = map.levels.size();
  if (before && before->levels.size() != nodes) before.reset();
  if (cost_.size() != nodes) {
    before.reset();
    cost_.assign(nodes, std::numeric_limits<float>::infinity());
    moved_.assign(nodes, 0);
  }
  for (size_t i = 0; i < nodes; i++) {
    if (before && moved_[i] > known && cost_[i] <= choice.least[i] + choice.lead[i]) {
      map.levels[i] = before->levels[i];
      continue;
    }
    cost_[i] = choice.least[i];
    if (choice.chosen[i] != 0) moved_[i] = rounds_;
  }
}

}  // namespace lf
