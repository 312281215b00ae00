// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <deque>
#include <mutex>

#include <gst/gst.h>

// Custom upstream event from a node's request pad: how old captures have to be for its live cameras to have them. Field
// "delay" (uint64, nanoseconds).
#define LF_CAPTURE_DELAY_EVENT "lightfield-capture-delay"

namespace lf {

GstEvent* capture_delay_event(GstClockTime delay);
// False if it is another event.
bool parse_capture_delay(GstEvent* event, GstClockTime* delay);

// The capture delay that lfviewrequest follows: what nodes need. Grows at once, and shrinks when much less has been
// enough for some seconds. Thread-safe.
class AutoCaptureDelay {
 public:
  static constexpr GstClockTime kMost = 2 * GST_SECOND;  // no camera should take longer
  static constexpr GstClockTime kMemory = 10 * GST_SECOND;

  // A node says what it needs. True if the delay is another one from now on. `now`: of any steady clock.
  bool take(GstClockTime needed, GstClockTime now);
  GstClockTime delay() const;
  void clear();

 private:
  struct Report {
    GstClockTime time, needed;
  };
  mutable std::mutex mutex_;
  std::deque<Report> reports_;  // what nodes said within the last kMemory, each larger than all that came after it
  GstClockTime since_ = 0;      // when the first report of all came
  GstClockTime delay_ = 0;
};

}  // namespace lf
