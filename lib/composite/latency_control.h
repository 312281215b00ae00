// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <limits>
#include <optional>

namespace lf {

// Adapts the latency of a live picture, which is the time that the compositor waits for answers, to busy nodes. If all
// answers come after the deadlines of their pictures, the picture would not change any more although the nodes work.
// The latency therefore increases until answers are in time, and decreases again when they come early. A single slow
// node does not delay the picture. Times are in nanoseconds. Not thread-safe.
class LatencyControl {
 public:
  // The latency increases after kLatePictures pictures in a row without any answer in time, as soon as kLateAnswers
  // answers have come late meanwhile. It decreases after kEarlyPictures pictures in a row that were complete early
  // enough.
  static constexpr unsigned kLatePictures = 10, kLateAnswers = 5, kEarlyPictures = 150;
  // Factor of each step, and the largest factor of all steps.
  static constexpr double kStep = 1.5, kMost = 6;

  void add_late_answer() { late_answers_++; }
  // Records a picture. `spare` is the time from the last answer to the deadline, if all nodes answered in time;
  // otherwise nothing. Returns the latency for the following pictures. `latency` is the present one: if it is not the
  // latest result, the application has changed it.
  uint64_t next(uint64_t latency, bool any_answered, std::optional<uint64_t> spare);
  // Forgets all pictures. Returns the latency that the application has set, if the latest result was another.
  std::optional<uint64_t> clear();

 private:
  uint64_t set_ = 0, latest_ = 0;  // the latency that the application has set, and the latest result
  unsigned late_pictures_ = 0, late_answers_ = 0, early_pictures_ = 0;
  uint64_t least_spare_ = std::numeric_limits<uint64_t>::max();  // minimum of all early pictures
};

}  // namespace lf
