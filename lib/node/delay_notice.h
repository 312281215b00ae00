// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

namespace lf {

// When a requester is told how old captures have to be for its cameras: soon when that grows, else once a second. Times
// in nanoseconds of one clock. Not thread-safe.
class DelayNotice {
 public:
  static constexpr uint64_t kSecond = 1'000'000'000;

  // Whether it is time to look at what cameras need.
  bool is_due(uint64_t now) const { return now >= looked_at_ + kSecond / 10; }
  // They need that much; 0: nothing is known. Whether the requester is to be told.
  bool see(uint64_t needed, uint64_t now) {
    if (needed == 0) return false;
    looked_at_ = now;
    if (needed <= told_ && now < told_at_ + kSecond) return false;
    told_ = needed;
    told_at_ = now;
    return true;
  }
  void clear() { *this = {}; }

 private:
  uint64_t told_ = 0, told_at_ = 0, looked_at_ = 0;
};

}  // namespace lf
