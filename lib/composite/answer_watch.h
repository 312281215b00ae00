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

// The requests of one view that had their turn last, for what answers to them still say when they come later. Sequence
// numbers wrap: the sign of a difference tells the order. Not thread-safe.
class PastRequests {
 public:
  static constexpr size_t kMost = 32;  // requests whose late answers are still signs of life

  // A request has its turn. True if it is before the last one: its viewer has begun anew, and all is forgotten.
  bool begin(uint32_t sequence);
  // The request was composed of what had come at its deadline, in nanoseconds of any clock; or it was left out.
  void composed(uint32_t sequence, uint64_t deadline);
  void skipped(uint32_t sequence);
  void clear();

  enum class Answer {
    kToSkipped,  // the request was left out: nobody waited for the answer
    kLate,       // the answer came too late for the picture
    kInTime,     // the answer missed the picture, but was there before the deadline: its node was not waited for
  };
  // Judges an answer that comes now to a request before the one that has its turn.
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

// Judges which cameras are out of order by the answers to one view's requests: a camera that is missing from so many
// pictures in a row is taken out of service, so that its neighbours close the gap, and put back when it has been in
// some again. Not thread-safe.
class CameraHealth {
 public:
  // Pictures in a row that a camera is seen in before it is put back: one that comes and goes stays out.
  static constexpr unsigned kBackAfter = 3;

  // A camera may be missing from `max_missed` pictures in a row; 0: from any number, and none is ever taken out.
  explicit CameraHealth(unsigned max_missed = 0) : max_missed_(max_missed) {}

  // Cameras 0 to count - 1 are expected: they are missing even if they never answer. Others are known once they answer.
  void expect(size_t count);
  // Tells the hash of the rig that cameras are of; 0: not known, which changes nothing. Cameras are known by their
  // index, which in another rig may be another camera's or nobody's: with another rig than before all that was known is
  // forgotten. True if out_of_service() is another now.
  bool use_rig(uint64_t hash);
  // Notes cameras whose answers were in time, but came after their picture was made: they count for the next one. Those
  // of another rig do not.
  void seen_late(uint64_t rig, const CameraRanges& seeing);
  // One more picture has been made; `seeing` are the cameras that answered in time with pictures of theirs. A picture
  // of none counts for nothing: then it is not the cameras that are out of order. True if out_of_service() is another
  // now.
  bool picture(CameraRanges seeing);

  const CameraSet& out_of_service() const { return out_; }

 private:
  struct Camera {
    bool known = false, out = false;
    unsigned missed = 0, seen = 0;  // pictures in a row that the camera is missing from, or in
  };
  unsigned max_missed_;
  uint64_t rig_ = 0;
  size_t expected_ = 0;
  CameraRanges seen_late_;
  std::vector<Camera> cameras_;
  CameraSet out_;
};

// Notices that a view's compositor has nothing to show: that nobody asks for the view, or that no node answers. Each is
// said once, and once more where nodes that had answered fall silent again. Times are of any one clock, microseconds,
// and not 0. Who sees requests come and who makes pictures may be two threads; answered() is for any thread.
class SilenceWatch {
 public:
  static constexpr int64_t kPatience = 5'000'000;

  // Forgets everything. Call before any of the other functions runs.
  void clear() {
    others_since_ = silent_since_ = composed_at_ = 0;
    asked_ = answered_ = told_ = ever_answered_ = false;
  }
  // A request of the view has come.
  void asked() { asked_ = true; }
  // A request of another view has come. True where for kPatience there have been none of this one: most often a wrong
  // view id.
  bool others_asked(int64_t now) {
    if (others_since_ == 0) others_since_ = now;
    if (asked_ || now < others_since_ + kPatience) return false;
    asked_ = true;
    return true;
  }
  void answered() { answered_ = true; }
  // A request of the view has been composed in real time. True where for so long now no answer has come to any of
  // those that followed each other.
  bool composed(int64_t now) {
    // Views followed each other without a pause.
    const bool goes_on = now < std::exchange(composed_at_, now) + kPatience;
    if (answered_.exchange(false)) {
      ever_answered_ = true;
      told_ = false;
      silent_since_ = now;
    }
    if (told_) return false;
    if (!goes_on || silent_since_ == 0) silent_since_ = now;
    return told_ = now >= silent_since_ + kPatience;
  }
  // Whether composed() has said so since the last answer.
  bool is_silent() const { return told_; }
  // Whether an answer had ever come by then.
  bool ever_answered() const { return ever_answered_; }

 private:
  int64_t others_since_ = 0;
  bool asked_ = false;
  std::atomic<bool> answered_ = false;
  int64_t silent_since_ = 0, composed_at_ = 0;
  bool told_ = false, ever_answered_ = false;
};

}  // namespace lf
