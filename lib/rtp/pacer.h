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
  // When the next packet may leave, not before `now`.
  uint64_t next(uint64_t now) const { return std::max(now + kAhead, next_.value_or(now)) - kAhead; }
  // `bytes` leave at `time`; `bits_per_second` not 0.
  void sent(uint64_t time, uint64_t bytes, uint64_t bits_per_second) {
    next_ = std::max(time, next_.value_or(time)) +
            static_cast<uint64_t>(8e9 * static_cast<double>(bytes) / static_cast<double>(bits_per_second));
  }
  void clear() { next_.reset(); }

  static constexpr uint64_t kAhead = 250'000;  // nanoseconds: 31 KB at a gigabit per second

 private:
  std::optional<uint64_t> next_;
};

}  // namespace lf::rtp
