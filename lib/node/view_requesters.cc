// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/view_requesters.h"

#include <algorithm>

namespace lf {

std::shared_ptr<Node::Requester> ViewRequesters::of(uint32_t view_id) {
  const std::lock_guard lock(mutex_);
  auto found = views_.find(view_id);
  if (found == views_.end()) {
    const auto used = [](const auto& view) { return view.second.used; };
    if (views_.size() >= 2 * kMostViews) views_.erase(std::ranges::min_element(views_, {}, used));
    const auto requester = std::make_shared<Node::Requester>();
    requester->cancelled = cancelled_;
    requester->images = images_;
    const auto latest = std::ranges::max_element(views_, {}, used);
    if (latest != views_.end()) requester->maker.begin_like(latest->second.requester->maker);
    found = views_.emplace(view_id, View{requester}).first;
  }
  found->second.used = ++uses_;
  return found->second.requester;
}

uint64_t ViewRequesters::nanoseconds(uint32_t view_id, double work) const {
  const std::lock_guard lock(mutex_);
  const auto found = views_.find(view_id);
  return found == views_.end() ? 0 : found->second.requester->estimate.nanoseconds(work);
}

void ViewRequesters::clear() {
  const std::lock_guard lock(mutex_);
  views_.clear();
}

}  // namespace lf
