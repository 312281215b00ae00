// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>
#include <mutex>

#include <gst/gst.h>

#include "base/maths.h"
#include "focus/focus_control.h"
#include "quality/camera_monitor.h"

namespace lf {

// What lfcompositor has done and how long its stages took. Thread-safe.
class CompositorStats {
 public:
  enum Counter {
    kLateAnswers,
    kBadRequests,
    kBadAnswers,
    kRigMismatches,
    kRepeatedAnswers,
    kRepeatedPictures,
    kDroppedPictures,
    kSkippedRequests,
    kStrayAnswers,    // answers to requests that nobody has made
    kCardPictures,    // pictures that were made on a graphics card
    kFailedPictures,  // pictures that failed for lack of memory or another exception
    kNumCounters
  };

  // One finished picture. Times are g_get_monotonic_time(), microseconds.
  struct Picture {
    uint32_t view_id = 0, sequence = 0;
    GstClockTime pts = GST_CLOCK_TIME_NONE;
    unsigned fragments = 0, missing = 0, damaged = 0;
    // Share of the view's pixels that cameras can see, 0..1; negative: not known, because there is no rig.
    double coverage = -1;
    uint64_t bytes = 0;        // bytes of the answers
    uint64_t trial_bytes = 0;  // bytes of answers to trials
    uint64_t skew_ns = 0;      // largest |capture time - target time|
    int64_t answered = 0;      // when the last answer was in, or the deadline over
    int64_t adding = 0;        // how long answers were decoded and added
    int64_t done = 0;          // when the picture was ready
  };

  void reset();
  void count(Counter counter);
  void set_out_of_service(size_t cameras);
  // Notes what the focus is after a picture, and how many bytes the answers to the picture's trials had.
  void set_focus(const FocusControl::State& state, uint64_t trial_bytes);
  // Adds bytes of answers to the monitor's probes, which do not count as the view's.
  void add_monitor_bytes(uint64_t bytes);
  void set_monitor(const CameraMonitor& monitor);
  void request_arrived(uint32_t sequence, int64_t time);
  void request_skipped(uint32_t sequence);
  struct Totals {
    uint64_t pictures, skipped;
  };
  Totals totals() const;
  // Adds the picture up; the structure of its element message "lightfield-view" if `describe`, else null. A picture of
  // which no camera sees anything is not complete.
  GstStructure* record(const Picture& picture, bool describe);
  // The `stats` property; owned by the caller.
  GstStructure* structure() const;

 private:
  mutable std::mutex mutex_;
  uint64_t counters_[kNumCounters] = {};
  uint64_t unseen_ = 0;  // pictures without a fragment, of which none is missing
  double coverage_ = -1;
  uint64_t pictures_ = 0, complete_ = 0, fragments_ = 0, missing_ = 0, damaged_ = 0, bytes_ = 0, max_skew_ns_ = 0,
           out_of_service_ = 0;
  FocusControl::State focus_;
  uint64_t trial_bytes_ = 0;
  std::optional<CameraMonitor> monitor_;  // the monitor as set_monitor() was last given it
  uint64_t monitor_bytes_ = 0;
  std::map<uint32_t, int64_t> arrivals_;               // sequence to time, of requests not answered yet
  Percentiles answer_ns_, composite_ns_, latency_ns_;  // request in to last answer in to picture ready
  Percentiles add_ns_, picture_ns_;                    // what compositing is: adding, and the picture from the sum
};

// An array of structures "lightfield-suspect": camera (uint: index in the rig), fault (string).
void set_suspects(GstStructure* structure, const char* field, const std::vector<CameraMonitor::Suspect>& suspects);

}  // namespace lf
