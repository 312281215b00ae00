// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include <gst/gst.h>

#include "common/gst_pointers.h"

namespace lf::serve {

// Checks if a playing pipeline makes progress: no sink holds a buffer all the time, and answers and pictures follow
// when requests and packets arrive. An idle pipeline without input has no problem. Main thread only.
class ProgressCheck {
 public:
  explicit ProgressCheck(GstElement* pipeline) : pipeline_(pipeline) {}  // borrowed
  ProgressCheck(const ProgressCheck&) = delete;

  // Describes what has not progressed since the previous call; "" if there is no problem. Does not return if an element
  // never releases its lock.
  std::string problem();

 private:
  struct Counts {
    uint64_t in = 0, out = 0;
    bool is_waiting = false;  // there was input after the latest result
  };
  std::string stopped_element();
  std::string blocked_sink();

  GstElement* const pipeline_;
  std::map<size_t, Counts> counts_;                                    // by row of the table of counters
  std::map<std::string, std::shared_ptr<std::atomic<bool>>> is_busy_;  // by path of the pad of a sink
};

}  // namespace lf::serve
