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

// Remembers the latest requests of one view, to classify answers that arrive after their picture was made. An answer
// may be late because its node is slow, or only because the compositor did not wait for this node. Sequence numbers
// wrap around, so the sign of the difference of two numbers tells which request is older. Not thread-safe.
class RequestHistory {
 public:
  static constexpr size_t kMost = 32;  // number of requests that can still get late answers

  // Records a new request. If the request precedes the last one, the viewer has restarted: the function then clears the
  // history and returns true.
  bool begin(uint32_t sequence);
  // Record what has happened to a request. composed() means that its picture was made. Answers up to `deadline`
  // (nanoseconds of any clock) would have been early enough for this picture. skipped() means that there is no picture.
  void composed(uint32_t sequence, uint64_t deadline);
  void skipped(uint32_t sequence);
  void clear();

  enum class Answer {
    // The request was skipped, so no answer could be early enough.
    kToSkipped,
    // The answer arrived after the deadline, or the request is unknown.
    kLate,
    // The answer missed the picture but arrived before the deadline, because the compositor did not wait for this node.
    kInTime,
  };
  // Classifies an answer to the earlier request `sequence` that arrives at the time `now`.
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

// Decides which cameras are out of service. A camera that is missing from too many consecutive pictures of a view is
// taken out of service, so that its neighbours close the gap in the camera mesh. The camera returns to service when it
// contributes again. Not thread-safe.
class CameraHealth {
 public:
  // Number of consecutive pictures with the camera before it returns to service.
  static constexpr unsigned kRecoveryPictures = 3;

  // `max_missed` is the number of consecutive pictures that a camera may miss before it is taken out of service; 0: no
  // limit.
  explicit CameraHealth(unsigned max_missed = 0) : max_missed_(max_missed) {}

  // Expects cameras 0 to count - 1, which count as missing even if they never answer. Other cameras are only expected
  // once they have answered.
  void expect(size_t count);
  // Call this before picture() with the hash of the rig that the answers were made with (0: unknown). If the rig has
  // changed, the state of all cameras is cleared, because an index may now mean another camera. Returns true if
  // out_of_service() has changed.
  bool use_rig(uint64_t hash);
  // Call this for an answer that missed its picture but arrived before the deadline (RequestHistory::Answer::kInTime).
  // Its cameras `seeing` work, so they count as present in the next picture. Answers with another rig hash are ignored.
  void add_late(uint64_t rig, const CameraRanges& seeing);
  // Updates the state of all cameras after a picture. `seeing` are the cameras that answered in time with an image. If
  // there is no such camera, the picture is ignored, because then the fault is elsewhere, for example in the network.
  // Returns true if out_of_service() has changed.
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
  CameraRanges late_cameras_;
  std::vector<Camera> cameras_;
  CameraSet out_;
};

// Detects two common configuration mistakes, which both lead to a missing picture. Either no client requests the view
// of this compositor (wrong view id), or no node answers its requests (wrong address or link). Each problem is reported
// once, and again if nodes stop answering later.
//
// All times are microseconds of the same clock and must not be 0. asked() and request_of_other_view() may run in one
// thread, and composed() in another. answered() may be called from any thread.
class SilenceDetector {
 public:
  // How long a problem must last before it is reported, microseconds.
  static constexpr int64_t kPatience = 5'000'000;

  // Clears the state. No other call may run at the same time.
  void clear() {
    others_since_ = silent_since_ = composed_at_ = 0;
    requested_ = answered_ = reported_ = ever_answered_ = false;
  }
  void asked() { requested_ = true; }
  // Call this for each request of another view. Returns true once if all requests for the duration of kPatience were
  // for other views, so that the user can be warned.
  bool request_of_other_view(int64_t now) {
    if (others_since_ == 0) others_since_ = now;
    if (requested_ || now < others_since_ + kPatience) return false;
    requested_ = true;
    return true;
  }
  void answered() { answered_ = true; }
  // Call this when the picture of a request is due. Returns true once if requests have come without a pause for
  // kPatience and no node has answered them, so that the user can be warned.
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
  bool requested_ = false;
  std::atomic<bool> answered_ = false;
  int64_t silent_since_ = 0, composed_at_ = 0;
  bool reported_ = false, ever_answered_ = false;
};

}  // namespace lf
