// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace lf {

// The largest of the sizes that were needed within the last minute, a minute more at most: memory that is kept for what
// comes next need not be larger. Times in nanoseconds of any one clock. Not thread-safe.
class PeakNeed {
 public:
  static constexpr uint64_t kMinute = 60'000'000'000;

  void see(size_t size, uint64_t now) {
    pass(now);
    latest_ = std::max(latest_, size);
  }
  size_t largest(uint64_t now) {
    pass(now);
    return std::max(latest_, before_);
  }

 private:
  void pass(uint64_t now) {
    if (now < began_ + kMinute) return;
    before_ = now < began_ + 2 * kMinute ? latest_ : 0;
    latest_ = 0;
    began_ = now;
  }

  uint64_t began_ = 0;
  size_t latest_ = 0, before_ = 0;  // largest sizes in the minute that began at began_, and in the one before
};

}  // namespace lf
