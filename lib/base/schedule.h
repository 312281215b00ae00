// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <chrono>
#include <cstdint>

namespace lf {

// Nanoseconds of a clock that never jumps, for measuring how long something takes.
inline uint64_t now_ns() {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  return static_cast<uint64_t>(std::chrono::duration_cast<std::chrono::nanoseconds>(now).count());
}

// The instants a rate of `numerator`/`denominator` frames per second stands for: instant k is k periods after time 0,
// rounded down to whole nanoseconds from the exact fraction, so that nothing drifts. In absolute clock time this is the
// capture schedule all cameras and viewers of that rate agree on without a word.
class Schedule {
 public:
  // The rate as a fraction, frames per second; both numbers are positive.
  Schedule(int numerator, int denominator) : numerator_(numerator), denominator_(denominator) {}

  // Nanoseconds.
  uint64_t instant(uint64_t k) const { return static_cast<uint64_t>(Wide{k} * denominator_ * kSecond / numerator_); }
  // The largest k with instant(k) <= nanoseconds.
  uint64_t index_at(uint64_t nanoseconds) const {
    // floor(k d S / n) <= t  <=>  k d S < (t + 1) n  <=>  k <= ((t + 1) n - 1) / (d S)
    return static_cast<uint64_t>(((Wide{nanoseconds} + 1) * numerator_ - 1) / (Wide{denominator_} * kSecond));
  }
  // The smallest k with instant(k) >= nanoseconds.
  uint64_t first_from(uint64_t nanoseconds) const { return nanoseconds == 0 ? 0 : index_at(nanoseconds - 1) + 1; }
  uint64_t period() const { return instant(1); }  // nanoseconds, rounded down

 private:
  static constexpr uint64_t kSecond = 1'000'000'000;
  __extension__ typedef unsigned __int128 Wide;  // clock time times a fraction's part does not fit 64 bits

  uint64_t numerator_, denominator_;
};

}  // namespace lf
