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

// A camera's picture as its stream gave it, in whatever memory. Thread-safe: views share it.
class CameraPicture {
 public:
  virtual ~CameraPicture() = default;
  virtual int width() const = 0;  // pixels
  virtual int height() const = 0;
  // Whether damage shows only where a view looks.
  virtual bool is_compressed() const { return false; }
  // Whether view() has to decode or to convert.
  virtual bool takes_work(PixelFamily family) const = 0;
  // The picture's pixels in this family, valid as long as the result lives; of a compressed picture those of `region`
  // alone. Null where they can't be had.
  virtual std::shared_ptr<const ImageView> view(PixelFamily family, const Rect& region) = 0;
  // The same in textures of the contexts of this group, where it is in such, valid as long as the picture lives; null:
  // it is not.
  virtual const ImageView* view_on_card(PixelFamily, gl::ShareGroup) { return nullptr; }
};

// A picture as compressed as it came, decoded where a view looks.
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

// What a camera showed at one time.
struct CameraFrame {
  std::shared_ptr<CameraPicture> picture;  // null: none could be had
  uint64_t behind = 0;                     // how much later it came than frames of this stream can, nanoseconds
  uint64_t time = 0;  // capture time, nanoseconds: clock time of live cameras, running time of others

  // Whether it is a picture of the size that the rig has the camera in.
  bool fits(const Camera& camera) const {
    return picture && picture->width() == camera.width && picture->height() == camera.height;
  }
};

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

// The rig of a node and which of its cameras the node has. Thread-safe: cameras come and go, and the rig is replaced,
// while requests are answered.
class CameraInputs {
 public:
  using Frames = std::shared_ptr<CameraFrames>;
  // The rig and the cameras as one request sees them. Never changes.
  struct Array {
    std::shared_ptr<const Rig> rig;
    std::shared_ptr<const CameraColours> colours;  // the colours of the rig's cameras
    uint64_t rig_hash = 0;
    double extent = 0;  // see array_extent()
    std::map<CameraIndex, Frames> cameras;
  };

  // Sets the rig; inputs keep the id of their camera. Returns what a user should know: cameras that the rig does not
  // have, or has in another size than their pictures are of (these count as missing); "" where all is well.
  std::string set_rig(std::shared_ptr<const Rig> rig);
  // The rig's camera of this id; null if there is none.
  std::shared_ptr<const Camera> camera(uint32_t id) const;

  // Adds an input. Until it is known which camera it is and what its pixels are, requests of files wait.
  void add(Frames frames);
  // False if another input has this camera already.
  bool set_camera(const Frames& frames, uint32_t id);
  void set_family(const Frames& frames, PixelFamily family);
  // The input's stream has ended: what is not known of it will never be.
  void give_up(const Frames& frames);
  void remove(const Frames& frames);

  std::shared_ptr<const Array> array() const;
  // As array(), once all inputs are known. Doesn't wait while `cancelled` or not running.
  std::shared_ptr<const Array> wait_for_all(const std::atomic<bool>& cancelled);
  void set_running(bool running);
  // Wakes all that wait, for inputs or for a frame, to look again at whether they are cancelled.
  void wake();

  // The pixel family of all answers, chosen for the first one and kNone before: RGB if an input has it then, else I420.
  // As requests of files wait until all inputs are known, it is not a matter of who comes first. Frames of the other
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
  void rearrange();  // locked

  std::atomic<PixelFamily> family_ = PixelFamily::kNone;
  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  bool running_ = false;
  std::map<Frames, Input> inputs_;
  std::shared_ptr<const Array> array_ = std::make_shared<Array>();  // made of inputs_ and the rig
};

// "3, 7 and 2 more".
std::string list_of_ids(const std::vector<uint32_t>& ids);

}  // namespace lf
