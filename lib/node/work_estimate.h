// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>

namespace lf {

// How long an answer takes, by what those before it have taken for their planned work. What it knows fades with each
// answer that was not made because of it, so that a slow minute does not end all answers. done() and skipped() from one
// thread, nanoseconds() from any.
class WorkEstimate {
 public:
  // Of work whose unit is a pixel's: what any answer takes beside, to look for frames, to plan and to wake threads.
  // With it what few pixels took tells little of many.
  static constexpr double kAnyAnswer = 65536;

  // Nanoseconds that an answer will take; 0: nothing is known.
  uint64_t nanoseconds(double work) const { return static_cast<uint64_t>(per_work_ * work); }
  void done(double work, uint64_t took) {
    if (work <= 0) return;
    const double now = static_cast<double>(took) / work;
    const double before = per_work_;
    per_work_ = before > 0 ? before + kShare * (now - before) : now;
  }
  void skipped() { per_work_ = per_work_ * (1 - kShare); }

 private:
  static constexpr double kShare = 1.0 / 8;
  std::atomic<double> per_work_ = 0;
};

}  // namespace lf
