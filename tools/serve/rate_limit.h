// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <list>
#include <map>
#include <string>

namespace lf::serve {

// A bucket that fills with `per_second` tokens, up to `burst`. Times are g_get_monotonic_time(), microseconds, and
// never go back. Without locks.
class TokenBucket {
 public:
  TokenBucket(double per_second, double burst) : per_second_(per_second), burst_(burst), tokens_(burst) {}

  // Takes so many tokens; false, and takes nothing, if there are fewer.
  bool take(int64_t now, double count = 1);
  // The tokens that are there stay, up to the new burst.
  void set_rate(double per_second, double burst, int64_t now);
  bool full(int64_t now);

 private:
  void fill(int64_t now);

  double per_second_, burst_, tokens_;
  int64_t filled_ = 0;
};

// A bucket for each of the latest kMaxAddresses addresses. One more takes the place of the address that was not seen
// for the longest time, so that a flood from many addresses never limits an address that took no part in it. Without
// locks.
class AddressLimit {
 public:
  static constexpr size_t kMaxAddresses = 4096;

  AddressLimit(double per_second, double burst) : per_second_(per_second), burst_(burst) {}

  bool take(const std::string& address, int64_t now) { return bucket(address, now).take(now); }
  size_t size() const { return entries_.size(); }

 private:
  struct Entry {
    TokenBucket bucket;
    std::list<std::string>::iterator place;
  };
  TokenBucket& bucket(const std::string& address, int64_t now);

  double per_second_, burst_;
  std::map<std::string, Entry> entries_;
  std::list<std::string> order_;  // addresses, the one seen last at the end
};

}  // namespace lf::serve
