// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/past_requests.h"

#include <algorithm>
#include <utility>

namespace lf {

bool PastRequests::begin(uint32_t sequence) {
  const std::optional<uint32_t> last = std::exchange(last_, sequence);
  if (!last || static_cast<int32_t>(sequence - *last) >= 0) return false;
  composed_.clear();
  skipped_.clear();
  return true;
}

void PastRequests::composed(uint32_t sequence, uint64_t deadline) {
  composed_.push_back({sequence, deadline});
  if (composed_.size() > kMost) composed_.pop_front();
}

void PastRequests::skipped(uint32_t sequence) {
  skipped_.push_back(sequence);
  if (skipped_.size() > kMost) skipped_.pop_front();
}

void PastRequests::clear() { *this = {}; }

PastRequests::Answer PastRequests::judge(uint32_t sequence, uint64_t now) const {
  if (std::ranges::find(skipped_, sequence) != skipped_.end()) return Answer::kToSkipped;
  const auto past = std::ranges::find(composed_, sequence, &Composed::sequence);
  if (past == composed_.end()) return Answer::kLate;
  // Answers are looked at when there is a request. Of the one before it nobody knows since when it has been there:
  // where requests are as far apart as the deadline, a node that nobody waits for would never be in time again.
  const bool is_latest = sequence == composed_.back().sequence;
  return is_latest || now <= past->deadline ? Answer::kInTime : Answer::kLate;
}

}  // namespace lf
