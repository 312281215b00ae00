// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <cstdint>
#include <map>
#include <optional>

namespace lf {

// Where in a recording the frames of live cameras belong, which are dated by a clock that may be set back. A camera
// then goes on right behind what it has given before, and the others by the same offset, so that all stay in step; each
// when its own frames show it, as some of before are still on their way. Times in nanoseconds. Not thread-safe.
class CaptureTimeline {
 public:
  // Frames that are out of order by less are no sign of a clock that was set back.
  static constexpr gint64 kSetBack = GST_SECOND;

  // `begin`: the clock's time where the recording begins.
  explicit CaptureTimeline(GstClockTime begin) : begin_(static_cast<gint64>(begin)) {}

  struct Place {
    gint64 time;      // counted from the beginning; negative: taken before it; of what has strayed far too early
    gint64 set_back;  // by how much the clock was, as this frame is the first one to show; else 0
  };
  Place place(uint32_t camera, GstClockTime captured);
  GstClockTime begin() const { return static_cast<GstClockTime>(begin_); }

 private:
  struct Camera {
    gint64 offset = 0;            // of its times, for what the clock was set back by
    gint64 newest = 0;            // its latest frame's time
    gint64 period = 0;            // between its latest two
    std::optional<gint64> stray;  // when the latest frame was taken, if that is long before `newest`
    bool is_seen = false;
  };
  // Whether a frame that would be at `time` is nearer to the others by the latest offset.
  bool belongs_to_latest(gint64 time, const Camera& camera) const;

  gint64 begin_;
  gint64 offset_ = 0;  // the latest one
  gint64 newest_ = 0;  // of all cameras
  std::map<uint32_t, Camera> cameras_;
};

}  // namespace lf
