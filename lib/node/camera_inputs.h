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

// A camera's frame as delivered by its stream, in any memory. Thread-safe: several views share a picture.
class CameraPicture {
 public:
  virtual ~CameraPicture() = default;
  virtual int width() const = 0;  // pixels
  virtual int height() const = 0;
  // True if damage is only detected when the damaged region is decoded.
  virtual bool is_compressed() const { return false; }
  virtual bool takes_work(PixelFamily family) const = 0;
  // Returns the pixels in this family, valid as long as the result lives; null on failure. A compressed picture decodes
  // only `region`.
  virtual std::shared_ptr<const ImageView> view(PixelFamily family, const Rect& region) = 0;
  // Returns the pixels in textures of this share group, valid as long as the picture lives; null if there are none.
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
  std::shared_ptr<CameraPicture> picture;  // null: no frame is available
  uint64_t behind = 0;                     // arrival delay beyond the smallest delay of this stream, nanoseconds
  uint64_t time = 0;  // capture time, nanoseconds: clock time of live cameras, otherwise running time

  bool fits(const Camera& camera) const {
    return picture && picture->width() == camera.width && picture->height() == camera.height;
  }
};

// The latest frames of one camera. Thread-safe.
//
// Live cameras: keeps the newest kLiveFrames and as many earlier frames as requests look back (up to kMaxReach and
// kMaxLiveBytes). No thread waits.
//
// File sources: the camera's streaming thread waits in push() until requests have moved on. Requests wait in find() for
// the frame of their time.
class CameraFrames {
 public:
  static constexpr size_t kLiveFrames = 4, kMaxLiveFrames = 1280, kFileFrames = 2;
  static constexpr uint64_t kMaxReach = 10'500'000'000;       // a capture-delay of 10 s, in nanoseconds
  static constexpr size_t kMaxLiveBytes = size_t{400} << 20;  // estimated bytes per camera

  enum class Mode {
    kStopped,  // no waiting, no frames accepted (initial state)
    kRunning,
    kFinished,  // all clients have ended: push() returns kEnded for file sources
  };
  void set_mode(Mode mode);

  void start_stream(bool live);
  enum class PushResult {
    kTaken,
    kStopped,  // stopped, or the stream is being flushed
    kEnded,    // file sources: no more requests will come
  };
  PushResult push(CameraFrame frame);
  // As push(), for a damaged frame: the previous frame also serves for this time.
  PushResult push_damaged(uint64_t time);
  // Sets how long after its capture the next pushed frame arrived, in nanoseconds.
  void note_arrival(int64_t late);
  void end_stream();                 // EOS: the last frame is valid for all later times
  void lose_stream();                // the camera failed: no frame after the last one until push()
  void set_flushing(bool flushing);  // drops all held frames
  void clear();                      // back to the initial state, except for the mode

  // Tells the camera that requests have reached `time`: frames that no request can need any more make room. Call this
  // also for cameras that a request does not use, so that they keep up.
  void advance(uint64_t time);
  // Returns the frame nearest to `time` (kNoTime: the newest). Waits as the class comment says; with `wait_for_first`
  // also for the first frame of a camera. Returns nothing if the camera has no frame or the node shuts down. Does not
  // wait while `cancelled` is true.
  std::optional<CameraFrame> find(uint64_t time, bool wait_for_first, const std::atomic<bool>* cancelled = nullptr);
  void wake();  // makes find() check for cancellation

  // Replaces a frame from find() that turned out to be damaged in a requested region: the previous frame serves from
  // now on. Sets *first (may be null) to true in the first call for this frame.
  std::optional<CameraFrame> replace_damaged(const CameraPicture* damaged, bool* first = nullptr);

  std::optional<CameraFrame> newest() const;
  bool is_live() const;
  // True after EOS: no frame is too old then.
  bool has_ended() const;
  // Nanoseconds between held frames; 0 for fewer than two frames. The median is the frame time of the camera; the mean
  // is longer if frames were dropped.
  uint64_t period() const;
  uint64_t mean_period() const;
  size_t held() const;

 private:
  // The caller holds mutex_ in all functions from here to wake_all().
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

  // The lock of a call. Frames dropped under the lock are freed after unlocking, because freeing GPU memory takes a
  // while.
  class Lock;

  struct Held {
    // Capture time of the original frame, even if `frame` replaces a damaged frame.
    uint64_t time;
    CameraFrame frame;  // no picture if there was no replacement
    // Picture that `frame` replaces; other threads may still use the damaged picture.
    std::shared_ptr<CameraPicture> damaged = {};
  };
  mutable std::mutex mutex_;
  std::condition_variable room_;     // wakes push()
  std::condition_variable arrived_;  // wakes find()
  Mode mode_ = Mode::kStopped;
  std::deque<Held> frames_;           // ascending time
  std::vector<CameraFrame> dropped_;  // to be freed after unlocking
  CameraFrame before_;                // latest compressed frame dropped from frames_, as a replacement
  bool started_ = false, live_ = false, ended_ = false, lost_ = false, flushing_ = false;
  uint64_t wanted_ = 0;           // latest requested time
  uint64_t reach_ = 0;            // live cameras: how far requests look back from the newest frame, nanoseconds
  int64_t earliest_ = INT64_MAX;  // smallest arrival delay of this stream, nanoseconds
  uint64_t behind_ = 0;
  uint64_t last_period_ = 0;  // nanoseconds between the two newest frames
};

// The rig of a node, and the cameras that the node has. Thread-safe: cameras and the rig may change while requests are
// answered.
class CameraInputs {
 public:
  using Frames = std::shared_ptr<CameraFrames>;
  // Immutable snapshot for one request.
  struct Array {
    std::shared_ptr<const Rig> rig;
    std::shared_ptr<const RigColourCorrections> colours;
    uint64_t rig_hash = 0;
    double extent = 0;  // see array_extent()
    std::map<CameraIndex, Frames> cameras;
  };

  // Sets the rig; inputs keep their camera id. Returns a warning about cameras that are not in the rig or differ from
  // it in image size (they count as missing), or "".
  std::string set_rig(std::shared_ptr<const Rig> rig);
  // Returns null if the rig has no camera with this id.
  std::shared_ptr<const Camera> camera(uint32_t id) const;

  // Adds an input. Requests for file sources wait for its camera and pixel family.
  void add(Frames frames);
  // Returns false if another input has this camera.
  bool set_camera(const Frames& frames, uint32_t id);
  void set_family(const Frames& frames, PixelFamily family);
  // Marks an input as ended: requests no longer wait for its camera or family.
  void give_up(const Frames& frames);
  void remove(const Frames& frames);

  std::shared_ptr<const Array> array() const;
  // Like array(), after waiting for the camera and family of all inputs. Does not wait while `cancelled` or not
  // running.
  std::shared_ptr<const Array> wait_for_all(const std::atomic<bool>& cancelled);
  void set_running(bool running);
  // Wakes all threads that wait for inputs or for a frame, so that they check for cancellation.
  void wake();

  // The pixel family of all answers, kNone until the first answer: RGB if an input has RGB then, otherwise I420. Other
  // frames are converted. Requests for file sources wait for all inputs, so the choice does not depend on timing.
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

// Formats ids like "3, 7 and 2 more".
std::string list_of_ids(const std::vector<uint32_t>& ids);

}  // namespace lf
