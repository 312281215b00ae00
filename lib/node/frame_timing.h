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

// Tells once when cameras have come to be off the capture times asked of them: by more than a frame time, and for
// longer than a lost frame explains. Without locks.
class SkewWatch {
 public:
  // Requests in a row before a camera counts as off, and before it counts as on again.
  static constexpr int kRequests = 5;

  // What one camera answered a request with. Times in nanoseconds of any one clock.
  struct Frame {
    CameraIndex camera = 0;
    uint64_t taken = 0, wanted = 0;
    uint64_t period = 0;  // nanoseconds between the camera's frames; 0: not known, and the camera is not judged
    uint64_t behind = 0;  // how much later it arrived than frames of this camera can
  };
  struct Report {
    CameraSet cameras;     // ascending; those that have come to be off with this request
    uint64_t skew = 0;     // the largest skew of these cameras, nanoseconds
    uint64_t period = 0;   // frame time of the camera with the largest skew, nanoseconds
    bool is_late = false;  // the frame of the camera with the largest skew is older than asked for
    uint64_t behind = 0;   // `behind` of the frame of that camera
  };
  // Takes the frames that answered a request, ascending cameras; returns what is to be told, if anything.
  std::optional<Report> see(std::span<const Frame> frames);

 private:
  struct State {
    bool off = false;
    int against = 0;  // requests in a row that say otherwise
  };
  std::map<CameraIndex, State> states_;
};

// How long after their capture the frames of one camera arrive. Times in nanoseconds of one clock. Thread-safe.
class ArrivalWatch {
 public:
  static constexpr size_t kFrames = 128;  // so many of the latest frames count
  // Nanoseconds without a frame, after which nothing is known of the camera.
  static constexpr uint64_t kSilence = 2'000'000'000;

  void arrived(uint64_t captured, uint64_t now) {
    const std::lock_guard lock(mutex_);
    delays_.add(now > captured ? now - captured : 0);
    latest_ = now;
  }
  // How old a capture has to be for its nearest frame to have arrived, but for one of a hundred: the delay of that
  // many, and half of `period`, by which the frame may be later than the time asked for. 0: not known.
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

// When a requester is told how old captures have to be for its cameras: soon when that grows, else once a second. Times
// in nanoseconds of one clock. Not thread-safe.
class DelayNotice {
 public:
  static constexpr uint64_t kSecond = 1'000'000'000;

  // Whether it is time to look at what cameras need.
  bool is_due(uint64_t now) const { return now >= looked_at_ + kSecond / 10; }
  // Takes what cameras need now; 0: nothing is known. Returns whether the requester is to be told of it.
  bool see(uint64_t needed, uint64_t now) {
    if (needed == 0) return false;
    looked_at_ = now;
    if (needed <= told_ && now < told_at_ + kSecond) return false;
    told_ = needed;
    told_at_ = now;
    return true;
  }
  void clear() { *this = {}; }

 private:
  uint64_t told_ = 0, told_at_ = 0, looked_at_ = 0;
};

}  // namespace lf
