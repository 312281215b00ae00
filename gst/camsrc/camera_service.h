// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>

#include <gst/gst.h>

namespace lf {

// Whether a camera serves, what became of it, and when to try again. Times are nanoseconds of a clock that never
// jumps. Thread-safe.
class CameraService {
 public:
  // kEnded: its source has an end, and came to it. kLost: it failed.
  enum class State { kStopped, kOpening, kRunning, kEnded, kLost };
  static constexpr uint64_t kShortestWait = 500'000'000, kLongestWait = 10'000'000'000;

  struct Report {
    State state = State::kStopped;
    std::string reason;    // why the camera was lost the latest time; "" if it never was
    uint64_t losses = 0;   // times it was lost
    uint64_t retries = 0;  // times it was opened again
    bool worked = false;   // has given a frame since the start
  };

  void start();  // is being opened, with nothing behind it
  void stop();
  // False if it was lost already, by another reason; the latest one counts.
  bool lose(const std::string& reason, uint64_t now);
  // How long to wait, after a loss or another attempt in vain: a quarter of the time that it has been out, so that a
  // camera comes back at most that much later than it could, within kShortestWait and kLongestWait. One that comes
  // back for no longer than it was waited for has been out all the time.
  uint64_t wait(uint64_t now);
  void retry();  // is being opened again; lost until it gives a frame
  // A first frame. True if the camera was lost.
  bool find(uint64_t now);
  void end();

  State state() const;
  Report report() const;

 private:
  mutable std::mutex mutex_;
  Report report_;
  uint64_t out_since_ = 0, found_ = 0, waited_ = 0;
};

const char* to_string(CameraService::State state);

// Leaves frames of one live camera undecoded where the machine can't decode all: when those that come out have been
// late for a while, what goes in is dropped up to the next key frame that can be on time. Late is what is later than
// the camera has been at best, and than its source states: a network's or a device's own delay is no lateness.
//
// Of the cameras of a process one after the other begins to drop, so that no more do than need be: the others may then
// keep up, and a camera that drops is one less for as long as a group of its pictures. Thread-safe.
class CameraShedder : public std::enable_shared_from_this<CameraShedder> {
 public:
  // Frames may be late by two of their periods, and by this, nanoseconds.
  static constexpr GstClockTimeDiff kTolerance = 100'000'000;
  // Frames have to be late for so long, and not catch up, before any is dropped.
  static constexpr uint64_t kPatience = 500'000'000;
  static constexpr uint64_t kBetween = 250'000'000;  // between the instants at which two cameras begin to drop

  // Watches the sink pad of `element`, if that decodes video. Before data flows through it.
  void watch(GstElement* element);

  // The stream begins anew. `paced`: its frames could come ahead of their time, so that none need be late.
  void restart(bool paced);

  enum class Verdict {
    kShow,
    kLeaveOut,     // a frame that went into the decoder before others were dropped
    kBeginToDrop,  // frames are dropped from now on; leave this one out, too
  };
  // A frame has come out: `pts` its time in the stream, `late` how much later than its running time it is (negative:
  // early), `latency` by how much its source says that it may be, `period` the time between the camera's frames (0: not
  // known), `now` nanoseconds of a clock that never jumps.
  Verdict see(GstClockTime pts, GstClockTimeDiff late, GstClockTime latency, GstClockTime period, uint64_t now);

  // By how many nanoseconds the newest frame was later than it could have been; 0: it was on time.
  GstClockTimeDiff behind() const;
  uint64_t dropped() const { return dropped_; }
  // The time in the stream at which the newest dropped frame ends; GST_CLOCK_TIME_NONE where none was since the last
  // call.
  GstClockTime take_dropped_end();

 private:
  static GstPadProbeReturn on_input(GstPad* pad, GstPadProbeInfo* info, gpointer data);
  bool drops(GstBuffer* buffer);
  void forget_position();

  mutable std::mutex mutex_;
  GstClockTimeDiff best_ = G_MAXINT64, behind_ = 0;
  uint64_t late_since_ = 0;                        // 0: not late
  GstClockTimeDiff late_by_ = 0;                   // by how much frames were late at late_since_
  GstClockTime skip_until_ = GST_CLOCK_TIME_NONE;  // stream time up to which input is dropped; none: nothing is
  GstClockTime show_from_ = GST_CLOCK_TIME_NONE;  // stream time up to which decoded frames are not shown; none: all are
  GstClockTime dropped_end_ = GST_CLOCK_TIME_NONE;
  std::atomic<uint64_t> dropped_ = 0;
};

}  // namespace lf
