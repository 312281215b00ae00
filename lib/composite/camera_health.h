// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "rig/rig.h"

namespace lf {

// The latest requests of one view. They tell whether a late answer missed its picture or belongs to a request that was
// skipped. Sequence numbers wrap around, so the sign of a difference gives the order. Not thread-safe.
class RequestHistory {
 public:
  static constexpr size_t kMost = 32;  // number of requests that can still get late answers

  // Starts a request. Returns true and clears the history if the request precedes the last one, because the viewer has
  // restarted.
  bool begin(uint32_t sequence);
  // Records that the picture was made from the answers that had arrived by `deadline` (nanoseconds of any clock), or
  // that the request was skipped.
  void composed(uint32_t sequence, uint64_t deadline);
  void skipped(uint32_t sequence);
  void clear();

  enum class Answer {
    kToSkipped,
    kLate,
    // The answer missed the picture but arrived before the deadline, because the compositor did not wait for this node.
    kInTime,
  };
  // Judges an answer that arrives now and belongs to an earlier request.
  Answer judge(uint32_t sequence, uint64_t now) const;

 private:
  struct Composed {
    uint32_t sequence;
    uint64_t deadline;
  };
  std::deque<Composed> composed_;
  std::deque<uint32_t> skipped_;
  std::optional<uint32_t> last_;
};

// Decides which cameras are out of service. A camera that is missing from too many consecutive pictures of a view
// leaves service, so that its neighbours close the gap. It returns when it contributes again. Not thread-safe.
class CameraHealth {
 public:
  // Number of consecutive pictures with the camera before it returns to service. An intermittent camera therefore stays
  // out.
  static constexpr unsigned kRecoveryPictures = 3;

  // `max_missed` is the number of consecutive pictures that a camera may miss; 0: no limit.
  explicit CameraHealth(unsigned max_missed = 0) : max_missed_(max_missed) {}

  // Expects cameras 0 to count - 1, which count as missing even if they never answer. Other cameras are only expected
  // once they have answered.
  void expect(size_t count);
  // Sets the rig hash; 0 (unknown) changes nothing. A new rig clears the state, because its indices may mean other
  // cameras. Returns true if out_of_service() changed.
  bool use_rig(uint64_t hash);
  // Adds cameras that answered before the deadline but after their picture was made. They count for the next picture.
  // Cameras of another rig are ignored.
  void add_late(uint64_t rig, const CameraRanges& seeing);
  // Call after each picture. `seeing` are the cameras that answered in time with an image. A picture without any camera
  // is ignored, because then the fault is elsewhere, for example in the network. Returns true if out_of_service()
  // changed.
  bool picture(CameraRanges seeing);

  const CameraSet& out_of_service() const { return out_; }

 private:
  struct Camera {
    bool known = false, out = false;
    unsigned missed = 0, seen = 0;  // consecutive pictures without and with the camera
  };
  unsigned max_missed_;
  uint64_t rig_ = 0;
  size_t expected_ = 0;
  CameraRanges seen_late_;
  std::vector<Camera> cameras_;
  CameraSet out_;
};

// Notices if no client requests the view, or if no node answers. Each problem is reported once, and again if nodes stop
// answering later. All times are microseconds of the same clock and not 0. Requests and pictures may be handled in two
// different threads; answered() may be called from any thread.
class SilenceDetector {
 public:
  static constexpr int64_t kPatience = 5'000'000;

  // Clears the state. No other call may run at the same time.
  void clear() {
    others_since_ = silent_since_ = composed_at_ = 0;
    asked_ = answered_ = reported_ = ever_answered_ = false;
  }
  void asked() { asked_ = true; }
  // Call for each request of another view. Returns true once if all requests for the duration of kPatience were for
  // other views. The usual cause is a wrong view id.
  bool request_of_other_view(int64_t now) {
    if (others_since_ == 0) others_since_ = now;
    if (asked_ || now < others_since_ + kPatience) return false;
    asked_ = true;
    return true;
  }
  void answered() { answered_ = true; }
  // Call when the picture of a request is due. Returns true once if requests have come without a pause for kPatience,
  // and none of them was answered.
  bool composed(int64_t now) {
    const bool goes_on = now < std::exchange(composed_at_, now) + kPatience;
    if (answered_.exchange(false)) {
      ever_answered_ = true;
      reported_ = false;
      silent_since_ = now;
    }
    if (reported_) return false;
    if (!goes_on || silent_since_ == 0) silent_since_ = now;
    return reported_ = now >= silent_since_ + kPatience;
  }
  bool is_silent() const { return reported_; }
  bool ever_answered() const { return ever_answered_; }

 private:
  int64_t others_since_ = 0;
  bool asked_ = false;
  std::atomic<bool> answered_ = false;
  int64_t silent_since_ = 0, composed_at_ = 0;
  bool reported_ = false, ever_answered_ = false;
};

}  // namespace lf
