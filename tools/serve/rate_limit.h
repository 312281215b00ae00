// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace lf::serve {

// A bucket that fills with `per_second` tokens, up to `burst`. Times are g_get_monotonic_time(), microseconds, and
// never go back. Without locks.
class TokenBucket {
 public:
  TokenBucket(double per_second, double burst) : per_second_(per_second), burst_(burst), tokens_(burst) {}

  // Takes a token; false if there is none.
  bool take(int64_t now);
  bool has_one(int64_t now) { return fill(now), tokens_ >= 1; }
  bool full(int64_t now);

 private:
  void fill(int64_t now);

  double per_second_, burst_, tokens_;
  int64_t filled_ = 0;
};

// A bucket for each of the latest addresses. At most kMaxAddresses: when more are busy, new ones share a bucket.
// Without locks.
class AddressLimit {
 public:
  static constexpr size_t kMaxAddresses = 4096;

  AddressLimit(double per_second, double burst) : per_second_(per_second), burst_(burst), others_(per_second, burst) {}

  bool take(const std::string& address, int64_t now) { return bucket(address, now).take(now); }
  // Whether take() would give a token to this address now.
  bool has_one(const std::string& address, int64_t now) { return bucket(address, now).has_one(now); }
  size_t size() const { return buckets_.size(); }

 private:
  TokenBucket& bucket(const std::string& address, int64_t now);

  double per_second_, burst_;
  std::map<std::string, TokenBucket> buckets_;
  TokenBucket others_;
};

}  // namespace lf::serve
