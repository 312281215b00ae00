// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rate_limit.h"

#include <algorithm>
#include <iterator>

namespace lf::serve {

void TokenBucket::fill(int64_t now) {
  if (filled_) tokens_ = std::min(burst_, tokens_ + static_cast<double>(now - filled_) * 1e-6 * per_second_);
  filled_ = now;
}

bool TokenBucket::take(int64_t now, double count) {
  fill(now);
  if (tokens_ < count) return false;
  tokens_ -= count;
  return true;
}

void TokenBucket::set_rate(double per_second, double burst, int64_t now) {
  fill(now);
  per_second_ = per_second;
  burst_ = burst;
  tokens_ = std::min(tokens_, burst);
}

bool TokenBucket::full(int64_t now) {
  fill(now);
  return tokens_ >= burst_;
}

TokenBucket& AddressLimit::bucket(const std::string& address, int64_t now) {
  auto found = entries_.find(address);
  if (found != entries_.end()) {
    order_.splice(order_.end(), order_, found->second.place);
    return found->second.bucket;
  }
  // A full bucket is as good as none.
  while (!order_.empty() && (entries_.size() >= kMaxAddresses || entries_.at(order_.front()).bucket.full(now))) {
    entries_.erase(order_.front());
    order_.pop_front();
  }
  order_.push_back(address);
  return entries_.emplace(address, Entry{TokenBucket(per_second_, burst_), std::prev(order_.end())})
      .first->second.bucket;
}

}  // namespace lf::serve
