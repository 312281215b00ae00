// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>

#include <gst/gst.h>

namespace lf {

// Tracks whether one camera works, and decides when a lost camera is opened again. The delay between attempts grows
// with the length of the outage, so that a camera with a loose cable returns quickly, but a camera that is switched off
// costs little work. All times are nanoseconds of a monotonic clock. Thread-safe.
class CameraLifecycle {
 public:
  // kEnded means that the source has delivered all its frames. kLost means that the camera has failed, and may be
  // opened again.
  enum class State { kStopped, kOpening, kRunning, kEnded, kLost };
  static constexpr uint64_t kMinRetryDelay = 500'000'000, kMaxRetryDelay = 10'000'000'000;

  struct Report {
    State state = State::kStopped;
    std::string reason;  // reason of the latest loss; "" if none
    // The number of times that the camera was lost, the number of attempts to open it again, and whether it has ever
    // delivered a frame, since start().
    uint64_t losses = 0;
    uint64_t retries = 0;
    bool worked = false;
  };

  void start();
  void stop();
  // Marks the camera as lost and stores the reason. Returns false if it was already lost.
  bool lose(const std::string& reason, uint64_t now);
  // Returns the delay before the next attempt to open the camera, in nanoseconds: a quarter of the time since the
  // outage began, but at least kMinRetryDelay and at most kMaxRetryDelay. For example, if a camera has been lost for 20
  // s, the next attempt follows after another 5 s. If a camera works only briefly (for less time than the last delay)
  // before it fails again, both failures count as one outage. Without this rule, a camera that fails directly after
  // each opening would be opened every half second.
  uint64_t wait(uint64_t now);
  void retry();  // call at each attempt; the camera stays lost until the first frame
  // Call at the first frame after opening. Returns true if the camera was lost, so that its return must be reported.
  bool find(uint64_t now);
  // Call at the regular end of the source.
  void end();

  State state() const;
  Report report() const;

 private:
  mutable std::mutex mutex_;
  Report report_;
  uint64_t out_since_ = 0, found_ = 0, waited_ = 0;
};

const char* to_string(CameraLifecycle::State state);

// Drops frames of a live camera before they are decoded, if the machine is too slow to decode the frames of all
// cameras. Without this class, the frames of all cameras would become later and later. The class measures how late
// frames leave the decoder, compared with the earliest frame of the same camera and with the latency of its source.
// Constant delays of network and device therefore do not count. If frames have been late for kMinLateTime, input is
// dropped until the next key frame that can be decoded in time.
//
// The cameras of a process start to drop frames one after another, at least kStagger apart. Each camera that drops
// frames relieves the machine, so the remaining cameras may recover, and no more cameras than necessary drop frames.
// Thread-safe.
class LoadShedder : public std::enable_shared_from_this<LoadShedder> {
 public:
  // A frame is on time if it is late by at most two frame periods or by this time in nanoseconds, whichever is longer.
  static constexpr GstClockTimeDiff kTolerance = 100'000'000;
  // Input is dropped if frames have been late for this long and their lateness has not halved; nanoseconds.
  static constexpr uint64_t kMinLateTime = 500'000'000;
  // Minimum time between the starts of dropping of two cameras, nanoseconds.
  static constexpr uint64_t kStagger = 250'000'000;

  // Watches the sink pad of `element` if it is a video decoder. Call before data flows.
  void watch(GstElement* element);

  // Call this when the camera is opened. `paced` means that the source delivers frames before their time, as live
  // playback of a file does. The least possible lateness is then 0, and need not be measured.
  void restart(bool paced);

  enum class Verdict {
    kShow,
    kDrop,           // the frame had entered the decoder before dropping began
    kStartDropping,  // dropping begins with this frame
  };
  // Call this for each decoded frame. The result says whether to deliver or drop the frame. `pts` is the timestamp of
  // the frame, and `late` is the time since its running time (negative: the frame is early). `latency` is the latency
  // of the source, `period` the frame period (0: unknown), and `now` a monotonic time. All values are nanoseconds.
  Verdict see(GstClockTime pts, GstClockTimeDiff late, GstClockTime latency, GstClockTime period, uint64_t now);

  // Returns how much later the newest frame left the decoder than the best frame of this camera, in nanoseconds; 0 if
  // it was on time.
  GstClockTimeDiff behind() const;
  uint64_t dropped() const { return dropped_; }
  // Returns the end (timestamp plus duration) of the last frame that was dropped since the previous call, or
  // GST_CLOCK_TIME_NONE if there is none. A looping film needs it to find its length if its last frames were dropped.
  GstClockTime take_dropped_end();

 private:
  GstPadProbeReturn on_input(GstPadProbeInfo* info);
  bool drops(GstBuffer* buffer);
  void forget_position();

  mutable std::mutex mutex_;
  GstClockTimeDiff best_ = G_MAXINT64, behind_ = 0;
  uint64_t late_since_ = 0;
  GstClockTimeDiff late_by_ = 0;
  GstClockTime skip_until_ = GST_CLOCK_TIME_NONE;  // end of the input to drop, as a timestamp; NONE: keep all
  // End of the decoded frames to drop, as a timestamp. These frames were in the decoder when dropping began. NONE: keep
  // all.
  GstClockTime show_from_ = GST_CLOCK_TIME_NONE;
  GstClockTime dropped_end_ = GST_CLOCK_TIME_NONE;
  std::atomic<uint64_t> dropped_ = 0;
};

}  // namespace lf
