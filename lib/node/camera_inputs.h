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

// The pixels of one camera frame, in any form: compressed, in system memory or on a GPU. The renderer asks for the form
// that it needs, so that only needed pixels are decoded or converted. Several views use the same picture, so all
// functions are thread-safe.
class CameraPicture {
 public:
  virtual ~CameraPicture() = default;
  virtual int width() const = 0;  // pixels
  virtual int height() const = 0;
  // True if damaged data is only noticed when the damaged region is decoded.
  virtual bool is_compressed() const { return false; }
  // Returns true if view() must decode, download or convert pixels, so that it is worth a separate thread.
  virtual bool takes_work(PixelFamily family) const = 0;
  // Returns the pixels in this family, or null on failure. They stay valid as long as the result lives. A compressed
  // picture decodes only `region`.
  virtual std::shared_ptr<const ImageView> view(PixelFamily family, const Rect& region) = 0;
  // Returns the pixels in textures of this share group, or null if there are none. They stay valid as long as the
  // picture lives.
  virtual const ImageView* view_on_gpu(PixelFamily, gl::ShareGroup) { return nullptr; }
};

// A JPEG frame. view() decodes only the region that the view needs.
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

// A frame of one camera with its capture time.
struct CameraFrame {
  std::shared_ptr<CameraPicture> picture;  // null if no frame is available
  // How much longer the frame took to arrive than the fastest frame of the stream, nanoseconds.
  uint64_t behind = 0;
  uint64_t time = 0;  // capture time, nanoseconds: clock time for live cameras, otherwise running time

  bool fits(const Camera& camera) const {
    return picture && picture->width() == camera.width && picture->height() == camera.height;
  }
};

// Stores the latest frames of one camera between the thread that captures frames and the threads that answer requests.
// A request finds the frame of its time here. Thread-safe.
//
// For a live camera, no function waits. The class keeps the newest kLiveFrames frames. If requests ask for older
// frames, for example because other cameras have a long delay, it keeps frames for a longer time, up to kMaxReach and
// kMaxLiveBytes. For a file, frames and requests wait for each other. push() blocks the streaming thread until requests
// need a later frame. find() waits until the frame of the requested time has been pushed.
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
  // Call this instead of push() for a damaged frame with this capture time. Requests for this time then get the
  // previous frame.
  PushResult push_damaged(uint64_t time);
  // Sets how long after its capture the next pushed frame has arrived, in nanoseconds. push() stores the difference
  // from the fastest frame in CameraFrame::behind, which warnings about late cameras show.
  void note_arrival(int64_t late);
  void end_stream();  // end of stream: the last frame is valid for all later times
  // Call this if the camera has failed. Requests for later times then find no frame, until push() is called again.
  void lose_stream();
  void set_flushing(bool flushing);  // true drops all held frames
  void clear();                      // back to the initial state, except for the mode

  // Tells the camera that requests have reached `time`, so that earlier frames can be dropped. Call this for all
  // cameras at each request, even for cameras that do not contribute. A file camera reads its next frame only when
  // earlier frames are dropped, and would block otherwise.
  void advance(uint64_t time);
  // Returns the frame with the capture time nearest to `time` (kNoTime: the newest frame). For a file, the call waits
  // until this frame has been read. If `wait_for_first` is true, it also waits for the first frame of a live camera.
  // Returns nothing if the camera has no frame or the node shuts down. While *cancelled is true, the call does not
  // wait; call wake() after a change of *cancelled.
  std::optional<CameraFrame> find(uint64_t time, bool wait_for_first, const std::atomic<bool>* cancelled = nullptr);
  void wake();  // makes waiting find() calls check for cancellation

  // Call this if decoding shows that a frame from find() is damaged. Returns the frame that find() returns instead from
  // now on, usually the previous frame, or nothing. *first (may be null) becomes true in the first call for this frame,
  // so that each damaged frame is counted only once.
  std::optional<CameraFrame> replace_damaged(const CameraPicture* damaged, bool* first = nullptr);

  // Returns the newest frame, without waiting.
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
  // The latest compressed frame that was dropped from frames_. It can still replace a damaged frame.
  CameraFrame before_;
  bool started_ = false, live_ = false, ended_ = false, lost_ = false, flushing_ = false;
  uint64_t wanted_ = 0;
  uint64_t reach_ = 0;            // live cameras: how far requests look back from the newest frame, nanoseconds
  int64_t earliest_ = INT64_MAX;  // smallest arrival delay of this stream, nanoseconds
  uint64_t behind_ = 0;
  uint64_t last_period_ = 0;  // nanoseconds between the two newest frames
};

// The array as one node knows it: its rig, and the CameraFrames of the cameras that are connected to the node. Cameras
// and rig may change while requests are answered, so each request works with an immutable snapshot (Array).
// Thread-safe.
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

  // Sets the rig of the node. Connected inputs keep their camera ids. If an input has a camera id that the rig lacks,
  // or another image size than in the rig, the camera counts as missing, and the function returns a warning for the
  // user. Otherwise it returns an empty text.
  std::string set_rig(std::shared_ptr<const Rig> rig);
  std::shared_ptr<const Camera> camera(uint32_t id) const;

  // Adds an input. Requests for file sources wait until the camera and the pixel family of the input are known.
  void add(Frames frames);
  // Returns false if another input already has this camera.
  bool set_camera(const Frames& frames, uint32_t id);
  void set_family(const Frames& frames, PixelFamily family);
  // Call this for an input that will never have a camera or format, so that wait_for_all() ignores this input.
  void give_up(const Frames& frames);
  void remove(const Frames& frames);

  std::shared_ptr<const Array> array() const;
  // Does the same as array(), but first waits until the camera and the pixel family of all inputs are known. Does not
  // wait while `cancelled` is true or the node is not running.
  std::shared_ptr<const Array> wait_for_all(const std::atomic<bool>& cancelled);
  void set_running(bool running);
  // Wakes all threads that wait for inputs or frames, so that they check for cancellation.
  void wake();

  // The pixel family of all answers, because a compositor can only add pixels of the same family. It is kNone before
  // the first answer. choose_family() then selects RGB if any input has RGB, and otherwise I420. Frames in another
  // family are converted.
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
