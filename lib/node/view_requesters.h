// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <map>
#include <memory>

#include "node/node.h"

namespace lf {

// What a node keeps of each view that one requester asks for. Not thread-safe.
class ViewRequesters {
 public:
  // That may be in use at once; of as many more the one that was asked for longest ago is forgotten.
  static constexpr size_t kMostViews = 64;

  // `cancelled`: that of all these views.
  explicit ViewRequesters(std::shared_ptr<std::atomic<bool>> cancelled) : cancelled_(std::move(cancelled)) {}
  // A view that is new begins with what was learned of the one that was asked for last. To be held by who makes an
  // answer of it: the view may be forgotten meanwhile.
  std::shared_ptr<Node::Requester> of(uint32_t view_id);
  void clear() { views_.clear(); }

 private:
  struct View {
    std::shared_ptr<Node::Requester> requester;
    uint64_t used = 0;
  };
  const std::shared_ptr<std::atomic<bool>> cancelled_;
  std::map<uint32_t, View> views_;
  uint64_t uses_ = 0;
};

}  // namespace lf
