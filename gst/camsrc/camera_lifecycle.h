// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>

#include <gst/gst.h>

namespace lf {

// The state machine of one camera, with the time of the next attempt to reopen a lost camera. All times are nanoseconds
// of a monotonic clock. Thread-safe.
class CameraLifecycle {
 public:
  // kEnded: the source has ended regularly. kLost: the camera has failed.
  enum class State { kStopped, kOpening, kRunning, kEnded, kLost };
  static constexpr uint64_t kMinRetryDelay = 500'000'000, kMaxRetryDelay = 10'000'000'000;

  struct Report {
    State state = State::kStopped;
    std::string reason;  // reason of the latest loss; "" if none
    uint64_t losses = 0;
    uint64_t retries = 0;
    bool worked = false;
  };

  void start();
  void stop();
  // Marks the camera as lost and stores the reason. Returns false if it was already lost.
  bool lose(const std::string& reason, uint64_t now);
  // Returns the delay before the next attempt: a quarter of the outage so far, within kMinRetryDelay and
  // kMaxRetryDelay. An outage continues if the camera returned for less time than the last delay.
  uint64_t wait(uint64_t now);
  void retry();  // the camera is being reopened, and stays lost until the first frame
  // Call at the first frame after opening. Returns true if the camera was lost, so that its return must be reported.
  bool find(uint64_t now);
  void end();

  State state() const;
  Report report() const;

 private:
  mutable std::mutex mutex_;
  Report report_;
  uint64_t out_since_ = 0, found_ = 0, waited_ = 0;
};

const char* to_string(CameraLifecycle::State state);

// Drops frames of a live camera before they are decoded, if the machine cannot decode all frames. Otherwise the frames
// of all cameras would become later and later. If output frames have been late for kMinLateTime, input is dropped until
// a key frame that can be on time. Lateness is measured against the best frame of the camera and the latency that its
// source states, so that delays of network and device do not count.
//
// Cameras of the process start dropping one after another, at least kStagger apart. Meanwhile the other cameras may be
// able to keep up, so that no more cameras than necessary drop frames. Thread-safe.
class LoadShedder : public std::enable_shared_from_this<LoadShedder> {
 public:
  // A frame may be late by two frame periods or by this time in nanoseconds, whichever is longer.
  static constexpr GstClockTimeDiff kTolerance = 100'000'000;
  // Frames must be late for this long, without improvement, before input is dropped; nanoseconds.
  static constexpr uint64_t kMinLateTime = 500'000'000;
  static constexpr uint64_t kStagger = 250'000'000;

  // Watches the sink pad of `element` if it is a video decoder. Call before data flows.
  void watch(GstElement* element);

  // Call for a new stream. `paced`: frames can arrive early, so the best possible lateness is 0.
  void restart(bool paced);

  enum class Verdict {
    kShow,
    kDrop,           // the frame had entered the decoder before dropping began
    kStartDropping,  // dropping begins with this frame
  };
  // Registers an output frame. `pts`: stream time. `late`: lateness against its running time (negative: early).
  // `latency`: latency of the source. `period`: frame period (0: unknown). `now`: monotonic time. All in nanoseconds.
  Verdict see(GstClockTime pts, GstClockTimeDiff late, GstClockTime latency, GstClockTime period, uint64_t now);

  // Lateness of the newest frame beyond the best case, in nanoseconds; 0 if on time.
  GstClockTimeDiff behind() const;
  uint64_t dropped() const { return dropped_; }
  // Returns the end of the newest dropped frame in stream time, or GST_CLOCK_TIME_NONE if no frame was dropped since
  // the last call.
  GstClockTime take_dropped_end();

 private:
  static GstPadProbeReturn on_input(GstPad* pad, GstPadProbeInfo* info, gpointer data);
  bool drops(GstBuffer* buffer);
  void forget_position();

  mutable std::mutex mutex_;
  GstClockTimeDiff best_ = G_MAXINT64, behind_ = 0;
  uint64_t late_since_ = 0;
  GstClockTimeDiff late_by_ = 0;
  GstClockTime skip_until_ = GST_CLOCK_TIME_NONE;  // stream time until which input is dropped; NONE: no dropping
  // stream time until which decoded frames are dropped; NONE: no dropping
  GstClockTime show_from_ = GST_CLOCK_TIME_NONE;
  GstClockTime dropped_end_ = GST_CLOCK_TIME_NONE;
  std::atomic<uint64_t> dropped_ = 0;
};

}  // namespace lf
