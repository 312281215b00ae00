// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <map>
#include <memory>
#include <mutex>

#include "node/node.h"

namespace lf {

// What a node keeps of each view that one requester asks for. Of a view that nothing is known of yet nothing is
// expected: what others take tells nothing of it, as they may look where there is nothing to be seen. Thread-safe; a
// view's answers are made in one thread.
class ViewRequesters {
 public:
  // So many views may be in use at once; of as many more the one that was asked for longest ago is forgotten.
  static constexpr size_t kMostViews = 64;

  // What these views have in common is that of `common`.
  explicit ViewRequesters(const Node::Requester& common) : cancelled_(common.cancelled), images_(common.images) {}
  // What is kept of a view. A new one begins with what was learned of the view that was asked for last. Who makes an
  // answer of it holds it: the view may be forgotten meanwhile.
  std::shared_ptr<Node::Requester> of(uint32_t view_id);
  // How many nanoseconds its answer will take that has so much planned work.
  uint64_t nanoseconds(uint32_t view_id, double work) const;
  void clear();

 private:
  struct View {
    std::shared_ptr<Node::Requester> requester;
    uint64_t used = 0;
  };
  const std::shared_ptr<std::atomic<bool>> cancelled_;
  const std::shared_ptr<KeptImages> images_;
  mutable std::mutex mutex_;
  std::map<uint32_t, View> views_;
  uint64_t uses_ = 0;
};

}  // namespace lf
