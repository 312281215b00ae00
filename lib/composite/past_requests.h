// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

namespace lf {

// The requests of one view that had their turn last, for what answers to them still say when they come later. Sequence
// numbers wrap: the sign of a difference tells the order. Not thread-safe.
class PastRequests {
 public:
  static constexpr size_t kMost = 32;  // requests whose late answers are still signs of life

  // A request has its turn. True if it is before the last one: its viewer has begun anew, and all is forgotten.
  bool begin(uint32_t sequence);
  // The request was composed of what had come at its deadline, in nanoseconds of any clock; or it was left out.
  void composed(uint32_t sequence, uint64_t deadline);
  void skipped(uint32_t sequence);
  void clear();

  enum class Answer {
    kToSkipped,  // the request was left out: nobody waited for the answer
    kLate,       // the answer came too late for the picture
    kInTime,     // the answer missed the picture, but was there before the deadline: its node was not waited for
  };
  // Judges an answer that comes now to a request before the one that has its turn.
  Answer judge(uint32_t sequence, uint64_t now) const;

 private:
  struct Composed {
    uint32_t sequence;
    uint64_t deadline;
  };
  std::deque<Composed> composed_;
  std::deque<uint32_t> skipped_;
  std::optional<uint32_t> last_;
};

}  // namespace lf
