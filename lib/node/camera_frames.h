// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "node/camera_picture.h"
#include "view/view_request.h"

namespace lf {

// The latest frames of one camera. Thread-safe.
//
// Live cameras: the newest kLiveFrames are kept, and as many before them as requests look back (up to kLongestReach and
// kMostLiveBytes); nobody waits. Others: the camera's streaming thread waits in push()
// until requests have moved on, and requests wait in find() until the frame that belongs to their time is there.
class CameraFrames {
 public:
  static constexpr size_t kLiveFrames = 4, kMostLiveFrames = 1280, kFileFrames = 2;
  static constexpr uint64_t kLongestReach = 10'500'000'000;    // nanoseconds: a capture-delay of 10 s
  static constexpr size_t kMostLiveBytes = size_t{400} << 20;  // of one camera's frames, estimated

  enum class Mode {
    kStopped,  // nothing waits, nothing is taken (the state after construction)
    kRunning,
    kFinished,  // the last requester has ended: a camera that is not live is told EOS
  };
  void set_mode(Mode mode);

  void start_stream(bool live);
  enum class Pushed {
    kTaken,
    kStopped,  // the node is stopped or the stream is being flushed
    kEnded,    // no request will come any more for what is not live
  };
  // Hands over a frame.
  Pushed push(CameraFrame frame);
  // As push(), for a frame that is damaged: the one before it serves in its place, too.
  Pushed push_damaged(uint64_t time);
  // The next frame to be handed over comes so much later than it was taken, nanoseconds.
  void note_arrival(int64_t late);
  void end_stream();   // EOS: the last frame stands for all times after it
  void lose_stream();  // the camera failed: there is nothing after the last frame's time, until one comes again
  void set_flushing(bool flushing);  // the camera's stream is being flushed: drops what is held
  void clear();                      // back to the state after construction, but for the mode

  // Requests have come to `time`: frames that none of them can need any more make room for newer ones. For cameras
  // that a request does not look at, so that they don't fall behind.
  void advance(uint64_t time);
  // The frame nearest to `time` (kNoTime: the newest). Waits as the class comment says, and for the first frame of a
  // camera that has not begun if `wait_for_first`. Nothing if the camera has no frame to give or the node shuts down.
  // Doesn't wait while `cancelled`, if given.
  std::optional<CameraFrame> find(uint64_t time, bool wait_for_first, const std::atomic<bool>* cancelled = nullptr);
  void wake();  // find() looks at `cancelled` again

  // A frame from find() turned out to be damaged where a request looks: the one before it serves from now on. True in
  // *first (may be null) to the first that says so.
  std::optional<CameraFrame> replace_damaged(const CameraPicture* damaged, bool* first = nullptr);

  std::optional<CameraFrame> newest() const;
  bool is_live() const;
  // Whether end_stream() was the last that came: no frame is too old then.
  bool has_ended() const;
  // Nanoseconds from one of the frames held to the next, 0 where there are fewer than two: the median, which is the
  // camera's own, and the mean, which is longer where frames were dropped.
  uint64_t period() const;
  uint64_t mean_period() const;
  size_t held() const;

 private:
  bool must_wait(uint64_t time, bool wait_for_first) const;  // locked
  void want(uint64_t time);                                  // locked
  bool is_beyond_last(uint64_t time) const;                  // locked
  void drop_passed();                                        // locked
  void drop_oldest();                                        // locked
  void drop_all();                                           // locked
  void look_back(uint64_t time);                             // locked
  bool has_too_many() const;                                 // locked
  size_t most_frames() const;                                // locked
  void wake_all();                                           // locked

  Pushed push_at(uint64_t time, std::optional<CameraFrame> frame);

  // The lock of a call. Frames that are dropped under it go when a call has ended, without the lock: those on a card
  // take a while for that.
  class Lock;

  struct Held {
    uint64_t time;                                // time of the frame, or of the damaged one in whose place it serves
    CameraFrame frame;                            // has no picture where there was none to serve
    std::shared_ptr<CameraPicture> damaged = {};  // the picture in whose place `frame` serves: others may still hold it
  };
  mutable std::mutex mutex_;
  std::condition_variable room_;     // for push()
  std::condition_variable arrived_;  // for find()
  Mode mode_ = Mode::kStopped;
  std::deque<Held> frames_;           // ascending time
  std::vector<CameraFrame> dropped_;  // since the lock was taken
  CameraFrame before_;                // a compressed frame that was held before those of frames_
  bool started_ = false, live_ = false, ended_ = false, lost_ = false, flushing_ = false;
  uint64_t wanted_ = 0;           // time of the latest request that named one
  uint64_t reach_ = 0;            // how far behind the newest frame of a live camera requests look
  int64_t earliest_ = INT64_MAX;  // the least that a frame of this stream has arrived after its capture, nanoseconds
  uint64_t behind_ = 0;
  uint64_t last_period_ = 0;  // nanoseconds between the newest frame and the one before it
};

}  // namespace lf
