// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rate_limit.h"

#include <algorithm>

namespace lf::serve {

void TokenBucket::fill(int64_t now) {
  if (filled_) tokens_ = std::min(burst_, tokens_ + static_cast<double>(now - filled_) * 1e-6 * per_second_);
  filled_ = now;
}

bool TokenBucket::take(int64_t now) {
  fill(now);
  if (tokens_ < 1) return false;
  tokens_ -= 1;
  return true;
}

bool TokenBucket::full(int64_t now) {
  fill(now);
  return tokens_ >= burst_;
}

TokenBucket& AddressLimit::bucket(const std::string& address, int64_t now) {
  auto found = buckets_.find(address);
  if (found == buckets_.end()) {
    // A full bucket is as good as none.
    if (buckets_.size() >= kMaxAddresses)
      for (auto i = buckets_.begin(); i != buckets_.end();) i = i->second.full(now) ? buckets_.erase(i) : std::next(i);
    if (buckets_.size() >= kMaxAddresses) return others_;
    found = buckets_.emplace(address, TokenBucket(per_second_, burst_)).first;
  }
  return found->second;
}

}  // namespace lf::serve
