// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "image/image.h"
#include "jpeg/jpeg_frame.h"
#include "render/gl/context.h"
#include "rig/camera_source.h"
#include "rig/rig.h"
#include "view/view_request.h"

namespace lf {

// A frame as the camera's stream delivered it, in any kind of memory. Several views use the same picture, so all
// functions are thread-safe.
class CameraPicture {
 public:
  virtual ~CameraPicture() = default;
  virtual int width() const = 0;  // pixels
  virtual int height() const = 0;
  // True if damaged data is only noticed when the damaged region is decoded.
  virtual bool is_compressed() const { return false; }
  virtual bool takes_work(PixelFamily family) const = 0;
  // Returns the pixels in this family, or null on failure. They stay valid as long as the result lives. A compressed
  // picture decodes only `region`.
  virtual std::shared_ptr<const ImageView> view(PixelFamily family, const Rect& region) = 0;
  // Returns the pixels in textures of this share group, or null if there are none. They stay valid as long as the
  // picture lives.
  virtual const ImageView* view_on_gpu(PixelFamily, gl::ShareGroup) { return nullptr; }
};

class JpegPicture : public CameraPicture {
 public:
  explicit JpegPicture(std::shared_ptr<JpegFrame> frame) : frame_(std::move(frame)) {}
  int width() const override { return frame_->width(); }
  int height() const override { return frame_->height(); }
  bool is_compressed() const override { return true; }
  bool takes_work(PixelFamily) const override { return true; }
  std::shared_ptr<const ImageView> view(PixelFamily family, const Rect& region) override;

 private:
  const std::shared_ptr<JpegFrame> frame_;
};

struct CameraFrame {
  std::shared_ptr<CameraPicture> picture;  // null if no frame is available
  // how much longer the frame took to arrive than the fastest frame of the stream, nanoseconds
  uint64_t behind = 0;
  uint64_t time = 0;  // capture time, nanoseconds: clock time for live cameras, otherwise running time

  bool fits(const Camera& camera) const {
    return picture && picture->width() == camera.width && picture->height() == camera.height;
  }
};

// The latest frames of one camera. Requests look up the frame of their time here. Thread-safe.
//
// A live camera never waits. It keeps the newest kLiveFrames frames, and earlier frames if they are requested, up to
// kMaxReach and kMaxLiveBytes. A file source waits for the requests: push() blocks the streaming thread until requests
// have moved on, and find() waits for the frame of the requested time.
class CameraFrames {
 public:
  static constexpr size_t kLiveFrames = 4, kMaxLiveFrames = 1280, kFileFrames = 2;
  static constexpr uint64_t kMaxReach = 10'500'000'000;       // a capture delay of 10 s and a margin, in nanoseconds
  static constexpr size_t kMaxLiveBytes = size_t{400} << 20;  // estimated bytes per camera

  enum class Mode {
    kStopped,  // accepts no frames and never waits (initial state)
    kRunning,
    kFinished,  // all clients have ended, so push() returns kEnded for file sources
  };
  void set_mode(Mode mode);

  void start_stream(bool live);
  enum class PushResult {
    kTaken,
    kStopped,  // stopped, or the stream is flushing
    kEnded,    // file sources only: no request will come any more
  };
  PushResult push(CameraFrame frame);
  // Reports that a frame of this time was damaged. The previous frame then also serves requests for this time.
  PushResult push_damaged(uint64_t time);
  // Sets how long after its capture the next pushed frame arrived, in nanoseconds. The delay determines how long
  // requests should wait for frames.
  void note_arrival(int64_t late);
  void end_stream();  // end of stream: the last frame is valid for all later times
  // the camera failed: there is no frame after the last one until push() is called again
  void lose_stream();
  void set_flushing(bool flushing);  // true drops all held frames
  void clear();                      // back to the initial state, except for the mode

  // Reports that requests have reached `time`, so that frames that are no longer needed can be dropped. Call this for
  // all cameras, even if the request does not use them, because file sources would stop otherwise.
  void advance(uint64_t time);
  // Returns the frame nearest to `time` (kNoTime: the newest frame). For file sources, this waits for the frame; with
  // `wait_for_first`, it waits for the first frame of any camera. Returns nothing if the camera has no frame or the
  // node shuts down. Does not wait while *cancelled is true.
  std::optional<CameraFrame> find(uint64_t time, bool wait_for_first, const std::atomic<bool>* cancelled = nullptr);
  void wake();  // makes waiting find() calls check for cancellation

  // Call this if a frame from find() turns out to be damaged in the decoded region. Returns the frame that replaces it
  // from now on, usually the previous frame. Sets *first (may be null) to true in the first call for this frame.
  std::optional<CameraFrame> replace_damaged(const CameraPicture* damaged, bool* first = nullptr);

  std::optional<CameraFrame> newest() const;
  bool is_live() const;
  // Returns true after the end of the stream. No frame is too old then, because no newer frame will come.
  bool has_ended() const;
  // Return the interval between the held frames in nanoseconds, or 0 for fewer than two frames. The median is the frame
  // interval of the camera. The mean is longer if frames were dropped.
  uint64_t period() const;
  uint64_t mean_period() const;
  size_t held() const;

 private:
  // The caller must hold mutex_ in all functions from here to wake_all().
  bool must_wait(uint64_t time, bool wait_for_first) const;
  void want(uint64_t time);
  bool is_beyond_last(uint64_t time) const;
  void drop_outdated();
  void drop_oldest();
  void drop_all();
  void extend_history(uint64_t time);
  bool has_too_many() const;
  size_t most_frames() const;
  void wake_all();

  PushResult push_at(uint64_t time, std::optional<CameraFrame> frame);

  // Holds mutex_ for one call. Frames that the call drops are freed after unlocking, because freeing GPU memory takes a
  // while.
  class Lock;

  struct Held {
    // Capture time of the original frame, even if `frame` is a replacement.
    uint64_t time;
    CameraFrame frame;  // has no picture if the frame was damaged and no replacement existed
    // The damaged picture that `frame` replaces. Other threads may still use this picture.
    std::shared_ptr<CameraPicture> damaged = {};
  };
  mutable std::mutex mutex_;
  std::condition_variable room_;     // wakes push()
  std::condition_variable arrived_;  // wakes find()
  Mode mode_ = Mode::kStopped;
  std::deque<Held> frames_;           // ascending time
  std::vector<CameraFrame> dropped_;  // freed after unlocking
  // the latest compressed frame that was dropped from frames_, as a replacement for damaged frames
  CameraFrame before_;
  bool started_ = false, live_ = false, ended_ = false, lost_ = false, flushing_ = false;
  uint64_t wanted_ = 0;
  uint64_t reach_ = 0;            // live cameras: how far requests look back from the newest frame, nanoseconds
  int64_t earliest_ = INT64_MAX;  // smallest arrival delay of this stream, nanoseconds
  uint64_t behind_ = 0;
  uint64_t last_period_ = 0;  // nanoseconds between the two newest frames
};

// The rig of a node and the inputs of its cameras. Thread-safe: cameras and the rig may change while requests are
// answered.
class CameraInputs {
 public:
  using Frames = std::shared_ptr<CameraFrames>;
  // An immutable snapshot that a request works with.
  struct Array {
    std::shared_ptr<const Rig> rig;
    std::shared_ptr<const RigColourCorrections> colours;
    uint64_t rig_hash = 0;
    double extent = 0;
    std::map<CameraIndex, Frames> cameras;
  };

  // Sets the rig of the node. Inputs keep their camera ids. Returns a warning about inputs that are not in the rig or
  // have another image size, or an empty text. The cameras of these inputs count as missing.
  std::string set_rig(std::shared_ptr<const Rig> rig);
  std::shared_ptr<const Camera> camera(uint32_t id) const;

  // Adds an input. Requests for file sources wait until the camera and the pixel family of the input are known.
  void add(Frames frames);
  // Returns false if another input already has this camera.
  bool set_camera(const Frames& frames, uint32_t id);
  void set_family(const Frames& frames, PixelFamily family);
  void give_up(const Frames& frames);
  void remove(const Frames& frames);

  std::shared_ptr<const Array> array() const;
  // Does the same as array(), but first waits until the camera and the pixel family of all inputs are known. Does not
  // wait while `cancelled` is true or the node is not running.
  std::shared_ptr<const Array> wait_for_all(const std::atomic<bool>& cancelled);
  void set_running(bool running);
  // Wakes all threads that wait for inputs or frames, so that they check for cancellation.
  void wake();

  // The pixel family of all answers; kNone before the first answer. The first answer chooses RGB if any input has RGB,
  // otherwise I420, and other frames are converted.
  PixelFamily family() const { return family_; }
  PixelFamily choose_family();
  void forget_family() { family_ = PixelFamily::kNone; }

 private:
  struct Input {
    std::optional<uint32_t> id;
    PixelFamily family = PixelFamily::kNone;
    bool given_up = false;
    bool is_known() const { return given_up || (id && family != PixelFamily::kNone); }
  };
  void rebuild_array();  // caller holds mutex_

  std::atomic<PixelFamily> family_ = PixelFamily::kNone;
  mutable std::mutex mutex_;  // guards the members below
  std::condition_variable changed_;
  bool running_ = false;
  std::map<Frames, Input> inputs_;
  std::shared_ptr<const Array> array_ = std::make_shared<Array>();
};

// Formats ids for a message, for example "3, 7 and 2 more".
std::string list_of_ids(const std::vector<uint32_t>& ids);

}  // namespace lf
