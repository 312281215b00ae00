// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <vector>

#include <gst/gst.h>

#include "common/in_process.h"
#include "wire/commands.h"

namespace lf {

// A request that is to be answered, and what is known of it when it comes.
struct FragmentJob {
  wire::AnyRequest request;
  GstClockTime pts, duration;
  NearCompositor compositor;
  double work = 0;   // of its answer, see WorkEstimate
  uint64_t due = 0;  // live: when its answer is of no use any more, now_ns(); 0: never
};

// Requests that wait for their answers, of which those that may go together (Node::may_go_together()) are answered at
// once. Thread-safe.
class WaitingJobs {
 public:
  // Pixels of views that are answered at once at most, as all of their answers are held until the last one is made.
  static constexpr size_t kMostPixels = 16'000'000;

  // It waits as long as somebody holds it.
  void add(const std::shared_ptr<FragmentJob>& job);
  // How many nobody holds any more that have not been taken; they are forgotten.
  size_t forget_dropped();
  // Takes a job, and unless it is to go `alone` those that wait and may go with it; nothing if it has been taken.
  std::vector<std::shared_ptr<FragmentJob>> take_with(const std::shared_ptr<FragmentJob>& job, bool alone);

 private:
  std::mutex mutex_;
  std::deque<std::weak_ptr<FragmentJob>> waiting_;
};

}  // namespace lf
