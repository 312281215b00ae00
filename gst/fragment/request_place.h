// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <utility>

#include <gst/gst.h>

namespace lf {

// Where the requests of one requester are in time, so that it is seen when they go on elsewhere. The requests'
// streaming thread, but for is_live() and, while that is out, flush() and clear().
class RequestPlace {
 public:
  // A new segment; the requests come in real time or not.
  void begin(bool live) { live_ = live; }
  bool is_live() const { return live_; }
  // A request for this time came in this segment. Whether cameras that are read from files have to follow: after a
  // flush, and where a new segment goes back.
  bool moves(const GstSegment& segment, uint64_t time) {
    const bool back = !gst_segment_is_equal(&segment, &segment_) && time < last_time_;
    const bool moved = std::exchange(flushed_, false) || back;
    gst_segment_copy_into(&segment, &segment_);
    last_time_ = time;
    return moved && !live_;
  }
  void flush() { flushed_ = true; }
  void clear() {
    segment_ = {};
    last_time_ = 0;
    flushed_ = false;
  }

 private:
  std::atomic<bool> live_ = false;
  GstSegment segment_{};
  uint64_t last_time_ = 0;  // time of the latest request
  bool flushed_ = false;    // requests were flushed since the latest one
};

}  // namespace lf
