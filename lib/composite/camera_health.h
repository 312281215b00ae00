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

// The most recent requests of one view, used to judge late answers. Sequence numbers wrap: the sign of a difference
// gives the order. Not thread-safe.
class RequestHistory {
 public:
  static constexpr size_t kMost = 32;  // requests that can still get late answers

  // Starts a request. Returns true if it precedes the last one: the viewer has restarted, and the history is cleared.
  bool begin(uint32_t sequence);
  // Records that the request was composed from the answers that arrived by its deadline (nanoseconds, any clock), or
  // that it was skipped.
  void composed(uint32_t sequence, uint64_t deadline);
  void skipped(uint32_t sequence);
  void clear();

  enum class Answer {
    kToSkipped,
    kLate,
    // The answer missed the picture, but arrived before the deadline: the compositor did not wait for the node.
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

// Takes cameras out of service that are missing from too many consecutive pictures of one view, so that their
// neighbours close the gap. Puts them back when they contribute again. Not thread-safe.
class CameraHealth {
 public:
  // Consecutive pictures with the camera before it returns to service; an intermittent camera stays out.
  static constexpr unsigned kRecoveryPictures = 3;

  // `max_missed`: consecutive pictures that a camera may miss; 0: no limit.
  explicit CameraHealth(unsigned max_missed = 0) : max_missed_(max_missed) {}

  // Expects cameras 0 to count - 1: they count as missing even if they never answer. Other cameras are expected once
  // they have answered.
  void expect(size_t count);
  // Sets the rig hash; 0 (unknown) changes nothing. A new rig clears the state, because the indices may mean other
  // cameras. Returns true if out_of_service() changed.
  bool use_rig(uint64_t hash);
  // Adds cameras that answered before the deadline but after their picture was made: they count for the next picture.
  // Cameras of another rig are ignored.
  void add_late(uint64_t rig, const CameraRanges& seeing);
  // Call after each picture. `seeing`: cameras that answered in time with an image. A picture without any camera is
  // ignored, because the cause is then not a camera. Returns true if out_of_service() changed.
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

// Detects that no client requests the view, or that no node answers. Reports each once, and again if nodes that had
// answered fall silent. Times in microseconds of the same clock, not 0. Requests and pictures may be handled by two
// different threads; answered() may be called from any thread.
class SilenceDetector {
 public:
  static constexpr int64_t kPatience = 5'000'000;

  // Clears the state. Must not run concurrently with other calls.
  void clear() {
    others_since_ = silent_since_ = composed_at_ = 0;
    asked_ = answered_ = reported_ = ever_answered_ = false;
  }
  // Call for each request of this view.
  void asked() { asked_ = true; }
  // Call for each request of another view. Returns true once if for kPatience there were only requests of other views;
  // usually the view id is wrong.
  bool request_of_other_view(int64_t now) {
    if (others_since_ == 0) others_since_ = now;
    if (asked_ || now < others_since_ + kPatience) return false;
    asked_ = true;
    return true;
  }
  void answered() { answered_ = true; }
  // Call when a request has been composed in real time. Returns true once if requests have come without a pause for
  // kPatience and none was answered.
  bool composed(int64_t now) {
    // True if there was no pause between requests.
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
