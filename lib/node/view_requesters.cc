// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/view_requesters.h"

#include <algorithm>

namespace lf {

Node::Requester& ViewRequesters::of(uint32_t view_id) {
  auto found = views_.find(view_id);
  if (found == views_.end()) {
    const auto used = [](const auto& view) { return view.second->used; };
    // One that is in use, in an answer that was left for this one's, is among those asked for last.
    if (views_.size() >= 2 * kMostViews) views_.erase(std::ranges::min_element(views_, {}, used));
    auto view = std::make_unique<View>();
    view->requester.cancelled = cancelled_;
    const auto latest = std::ranges::max_element(views_, {}, used);
    if (latest != views_.end()) view->requester.maker.begin_like(latest->second->requester.maker);
    found = views_.emplace(view_id, std::move(view)).first;
  }
  found->second->used = ++uses_;
  return found->second->requester;
}

}  // namespace lf
