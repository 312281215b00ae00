// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <span>

#include "base/maths.h"
#include "rig/mesh.h"

namespace lf {

// Finds cameras that are not synchronised with the requests, so that the user can be warned. A camera counts as off if
// its frames are more than about a frame interval away from the requested times, in kRequests requests in a row. A
// single lost frame is therefore not reported. Each camera is reported once when it is off. Not thread-safe.
class SkewMonitor {
 public:
  // Number of consecutive requests before a camera counts as off, and before it counts as on time again.
  static constexpr int kRequests = 5;

  // A frame that a camera contributed to an answer. All times are nanoseconds of the same clock.
  struct Frame {
    CameraIndex camera = 0;
    uint64_t taken = 0, wanted = 0;
    uint64_t period = 0;  // frame interval of the camera, nanoseconds; 0: unknown, and the camera is not judged
    uint64_t behind = 0;  // how much longer the frame took to arrive than the camera's fastest frame, nanoseconds
  };
  struct Report {
    CameraSet cameras;     // cameras that newly count as off, ascending
    uint64_t skew = 0;     // nanoseconds; this and the values below describe the camera that is off most
    uint64_t period = 0;   // nanoseconds
    bool is_late = false;  // true if its frame is older than requested
    uint64_t behind = 0;   // nanoseconds
  };
  // Takes the frames of an answer in ascending camera order. Returns a report if cameras newly count as off.
  std::optional<Report> see(std::span<const Frame> frames);

 private:
  struct State {
    bool off = false;
    int against = 0;
  };
  std::map<CameraIndex, State> states_;
};

// Measures how long the frames of one camera take from their capture to their arrival at the node. The result
// determines how old a capture must be before a client requests this capture. All times are nanoseconds of the same
// clock. Thread-safe.
class ArrivalMonitor {
 public:
  static constexpr size_t kFrames = 128;
  // After this time without a frame, in nanoseconds, the delay counts as unknown.
  static constexpr uint64_t kSilence = 2'000'000'000;

  void arrived(uint64_t captured, uint64_t now) {
    const std::lock_guard lock(mutex_);
    delays_.add(now > captured ? now - captured : 0);
    latest_ = now;
  }
  // Returns how long a request should wait after its capture time, so that 99 % of requests find their nearest frame.
  // The result is 0 if unknown. It is the 99th percentile of the arrival delay plus half of `period`, because the
  // nearest frame may be that much later than the requested time.
  uint64_t needed(uint64_t period, uint64_t now) const {
    const std::lock_guard lock(mutex_);
    if (latest_ == 0 || now > latest_ + kSilence) return 0;
    return std::max<uint64_t>(delays_.at(99) + period / 2, 1);
  }
  void clear() {
    const std::lock_guard lock(mutex_);
    delays_.clear();
    latest_ = 0;
  }

 private:
  mutable std::mutex mutex_;
  Percentiles delays_{kFrames};
  uint64_t latest_ = 0;
};

// Decides when a node reports the capture delay of its cameras to a client. A larger delay is reported within a tenth
// of a second, because requests would miss frames. Otherwise, one report per second is enough. All times are
// nanoseconds of the same clock. Not thread-safe.
class DelayReporter {
 public:
  static constexpr uint64_t kSecond = 1'000'000'000;

  bool is_due(uint64_t now) const { return now >= checked_at_ + kSecond / 10; }
  // Takes the delay that the cameras need at present (0: unknown). Returns true if the delay should be sent to the
  // client.
  bool see(uint64_t needed, uint64_t now) {
    if (needed == 0) return false;
    checked_at_ = now;
    if (needed <= reported_ && now < reported_at_ + kSecond) return false;
    reported_ = needed;
    reported_at_ = now;
    return true;
  }
  void clear() { *this = {}; }

 private:
  uint64_t reported_ = 0, reported_at_ = 0, checked_at_ = 0;
};

}  // namespace lf
