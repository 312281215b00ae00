// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <chrono>
#include <cstdint>

namespace lf {

// Returns nanoseconds of a monotonic clock.
inline uint64_t now_ns() {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  return static_cast<uint64_t>(std::chrono::duration_cast<std::chrono::nanoseconds>(now).count());
}

// The capture schedule of a frame rate. Instant k is k periods after time 0, computed from the exact fraction and
// rounded down to whole nanoseconds, so the schedule does not drift.
class Schedule {
 public:
  // The frame rate is numerator / denominator frames per second; both must be positive.
  Schedule(int numerator, int denominator) : numerator_(numerator), denominator_(denominator) {}

  uint64_t instant(uint64_t k) const { return static_cast<uint64_t>(Wide{k} * denominator_ * kSecond / numerator_); }
  // Returns the largest k with instant(k) <= nanoseconds.
  uint64_t index_at(uint64_t nanoseconds) const {
    // floor(k d S / n) <= t  <=>  k d S < (t + 1) n  <=>  k <= ((t + 1) n - 1) / (d S)
    return static_cast<uint64_t>(((Wide{nanoseconds} + 1) * numerator_ - 1) / (Wide{denominator_} * kSecond));
  }
  // Returns the smallest k with instant(k) >= nanoseconds.
  uint64_t first_from(uint64_t nanoseconds) const { return nanoseconds == 0 ? 0 : index_at(nanoseconds - 1) + 1; }
  uint64_t period() const { return instant(1); }  // nanoseconds, rounded down

 private:
  static constexpr uint64_t kSecond = 1'000'000'000;
  __extension__ typedef unsigned __int128 Wide;  // because a clock time multiplied by a numerator exceeds 64 bits

  uint64_t numerator_, denominator_;
};

}  // namespace lf
