// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>

#include <gst/gst.h>

namespace lf {

// State and retry schedule of a camera. Times are nanoseconds of a monotonic clock. Thread-safe.
class CameraLifecycle {
 public:
  // kEnded: reached the end of its source. kLost: failed.
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
  // Returns false if the camera was already lost. Stores the reason in both cases.
  bool lose(const std::string& reason, uint64_t now);
  // Returns the delay before the next attempt: a quarter of the outage so far, within kMinRetryDelay and
  // kMaxRetryDelay. If a camera returns for less time than the last delay, the outage continues.
  uint64_t wait(uint64_t now);
  void retry();  // begins reopening; lost until the first frame
  // Registers the first frame. Returns true if the camera was lost.
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

// Drops input frames of one live camera if the machine cannot decode all frames. When output frames have been late for
// kMinLateTime, input is dropped until a key frame that can be on time. Lateness is relative to the camera's best and
// to the latency that its source states, so network and device delays do not count.
//
// Cameras of the process start dropping one after another, at least kStagger apart. The remaining cameras may then keep
// up, so that no more cameras than necessary drop frames. Thread-safe.
class LoadShedder : public std::enable_shared_from_this<LoadShedder> {
 public:
  // Tolerated lateness: the larger of two frame periods and this value, nanoseconds.
  static constexpr GstClockTimeDiff kTolerance = 100'000'000;
  // Minimum duration of lateness, without improvement, before frames are dropped, nanoseconds.
  static constexpr uint64_t kMinLateTime = 500'000'000;
  // minimum time between the start of dropping of two cameras, nanoseconds
  static constexpr uint64_t kStagger = 250'000'000;

  // Watches the sink pad of `element` if it is a video decoder. Call before data flows.
  void watch(GstElement* element);

  // Resets the state for a new stream. `paced`: frames can arrive early, so the best lateness is 0.
  void restart(bool paced);

  enum class Verdict {
    kShow,
    kDrop,           // entered the decoder before frames were dropped
    kStartDropping,  // dropping starts; drop this frame, too
  };
  // Registers an output frame. `pts`: stream time. `late`: lateness against its running time (negative: early).
  // `latency`: latency of the source. `period`: frame period (0: unknown). `now`: monotonic time. All in nanoseconds.
  Verdict see(GstClockTime pts, GstClockTimeDiff late, GstClockTime latency, GstClockTime period, uint64_t now);

  // Lateness of the newest frame beyond the best case, nanoseconds; 0: on time.
  GstClockTimeDiff behind() const;
  uint64_t dropped() const { return dropped_; }
  // Returns the stream time of the end of the newest dropped frame. GST_CLOCK_TIME_NONE if no frame was dropped since
  // the last call.
  GstClockTime take_dropped_end();

 private:
  static GstPadProbeReturn on_input(GstPad* pad, GstPadProbeInfo* info, gpointer data);
  bool drops(GstBuffer* buffer);
  void forget_position();

  mutable std::mutex mutex_;
  GstClockTimeDiff best_ = G_MAXINT64, behind_ = 0;
  uint64_t late_since_ = 0;  // 0: not late
  GstClockTimeDiff late_by_ = 0;
  GstClockTime skip_until_ = GST_CLOCK_TIME_NONE;  // stream time until which input is dropped; NONE: no dropping
  // stream time until which decoded frames are dropped; NONE: no dropping
  GstClockTime show_from_ = GST_CLOCK_TIME_NONE;
  GstClockTime dropped_end_ = GST_CLOCK_TIME_NONE;
  std::atomic<uint64_t> dropped_ = 0;
};

}  // namespace lf
