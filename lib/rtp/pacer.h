// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

namespace lf::rtp {

// Says when the next packets may leave so that a burst is spread out to a rate. Times in nanoseconds of any clock. Time
// that nothing was sent in is not made up for. Packets may leave a little ahead of their time: what is soon over does
// not have to wait. Not thread-safe.
class Pacer {
 public:
  // When the next packet may leave, not before `now`. A clock on which what was sent last lies in the future is another
  // one, or has been set back: nothing waits for that.
  uint64_t next(uint64_t now) {
    if (next_ && *next_ > now + lasts_ + 2 * kAhead) next_.reset();
    return std::max(now + kAhead, next_.value_or(now)) - kAhead;
  }
  // `bytes` leave at `time`, the latest that next() has said; `bits_per_second` not 0.
  void sent(uint64_t time, uint64_t bytes, uint64_t bits_per_second) {
    lasts_ = static_cast<uint64_t>(8e9 * static_cast<double>(bytes) / static_cast<double>(bits_per_second));
    next_ = std::max(time, next_.value_or(time)) + lasts_;
  }
  void clear() { next_.reset(); }

  static constexpr uint64_t kAhead = 250'000;  // nanoseconds: 31 KB at a gigabit per second

 private:
  std::optional<uint64_t> next_;
  uint64_t lasts_ = 0;  // at the rate, what was sent last
};

}  // namespace lf::rtp
