// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

#include <gst/gst.h>

#include "view/view_set.h"

namespace lf {

// Answers of a node that came before their request's turn, live, so that none of them stands in front of what comes
// behind it: a forged one is found out when its request has its turn, and hinders nothing until then. Not thread-safe.
class AheadAnswers {
 public:
  // By so many requests an answer may be ahead of the one that has its turn; two sets of views are among them.
  static constexpr int32_t kMostRequests = 64 + 2 * PlaceInSet::kMostViews;
  static constexpr size_t kMostBytes = size_t{64} << 20;
  static constexpr size_t kMostUnits = 4096;

  AheadAnswers() = default;
  ~AheadAnswers() { clear(); }
  AheadAnswers(const AheadAnswers&) = delete;
  AheadAnswers& operator=(const AheadAnswers&) = delete;

  // Whether there is room for one more of so many bytes; there always is for a single one.
  bool has_room(size_t bytes) const;
  // Takes over the buffer, an answer to the request of this number.
  void keep(uint32_t sequence, GstBuffer* buffer);
  // The answers to the request of this number in the order in which they came, owned by the caller. Answers to earlier
  // requests are thrown away.
  std::vector<GstBuffer*> take(uint32_t sequence);
  void clear();
  size_t size() const { return waiting_.size(); }

 private:
  struct Waiting {
    uint32_t sequence;
    GstBuffer* buffer;
  };
  std::deque<Waiting> waiting_;
  size_t bytes_ = 0;
};

}  // namespace lf
