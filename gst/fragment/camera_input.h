// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "common/gl_share.h"
#include "common/gst_pointers.h"
#include "common/properties.h"
#include "fragment/lffragment.h"
#include "fragment/raw_picture.h"
#include "node/camera_inputs.h"
#include "node/frame_timing.h"
#include "node/node.h"

namespace lf {

// Receives the video of one camera, behind one sink pad of lffragment. The class finds out which camera of the rig the
// video belongs to, checks size and format, and stores the frames in a CameraFrames, where the renderer looks for
// frames. It posts errors as messages of its element. Use from the pad's streaming thread, unless noted otherwise.
class CameraInput {
 public:
  // `element` owns the pad. Element and pad must outlive this object.
  CameraInput(LfFragment* element, LfFragmentPad* pad, Node& node) : element_(element), pad_(pad), node_(node) {}

  // Any thread.
  const std::shared_ptr<CameraFrames>& frames() const { return frames_; }
  bool is_live() const { return live_; }
  // Returns how long after its capture a frame of this camera usually arrives, in nanoseconds, so that requests wait
  // long enough (see ArrivalMonitor::needed()). 0 means unknown. `now` is the clock time.
  uint64_t needed_delay(uint64_t now) const { return arrivals_.needed(frames_->period(), now); }
  // Null if the camera is not known yet.
  std::shared_ptr<const Camera> camera() const;

  // Determines the camera from the pad's property, the stream, or the pad's number, in this order. Posts an error and
  // returns false if the rig has no such camera or the camera already has a pad.
  bool assign();
  // Stores the camera that the stream has announced with LF_CAMERA_EVENT.
  void name(CameraIndex camera);
  // Call this if the stream says that its frames are ready before their time ("paced" in LF_CAMERA_EVENT).
  void note_paced() { frames_->note_arrival(static_cast<int64_t>(latency_)); }
  bool set_caps(GstCaps* caps);
  // Call this at the start of a stream. `latency` is the latency of a live stream, or nothing if the stream is not
  // live.
  void start_stream(std::optional<GstClockTime> latency);
  // Stores a frame, and takes its reference. If the buffer does not carry a capture time, the time is computed from its
  // timestamp and `segment`, which may be null. Blocks for file cameras until requests need the frame.
  GstFlowReturn take(GstBuffer* buffer, const GstSegment* segment);
  // Forgets frames, format and camera. Call while the streaming thread is stopped.
  void reset();

 private:
  struct Format {
    bool jpeg = false;
    GstVideoInfo info{};
  };
  void take_format(const Format& format);
  bool check_size(int width, int height);
  uint64_t capture_time(GstBuffer* buffer, const GstSegment* segment) const;
  void note_arrival(uint64_t captured);
  GstBuffer* copy_if_pool_is_low(GstBuffer* buffer) const;
  GstFlowReturn take_raw(GstBuffer* buffer, uint64_t time);
  GstFlowReturn take_jpeg(GstBuffer* buffer, uint64_t time);

  LfFragment* const element_;
  LfFragmentPad* const pad_;
  Node& node_;
  const std::shared_ptr<CameraFrames> frames_ = std::make_shared<CameraFrames>();
  std::atomic<int64_t> id_ = -1;  // camera id in the rig; -1: not known yet
  std::optional<guint> stream_camera_id_;
  std::atomic<bool> live_ = false;  // true if frames arrive in real time; set by the segment
  ArrivalMonitor arrivals_;
  GstClockTime latency_ = 0;
  std::optional<Format> next_;
  std::optional<Format> format_;
  std::unique_ptr<FrameConverter> converter_;
  BufferPtr still_;  // the latest buffer, if later buffers may share its memory; or null
  std::shared_ptr<RawPicture> still_picture_;
  std::optional<std::pair<int, int>> jpeg_size_;
  bool warned_damaged_ = false;
  std::optional<std::pair<int, int>> valid_size_;  // latest frame size that matched the rig
};

}  // namespace lf

struct LfFragmentPadSettings {
  gint camera = -1;  // camera id in the rig; -1: named by the stream, otherwise the pad's number
  static lf::PropertyTable<LfFragmentPadSettings>& properties();
};

struct _LfFragmentPad {
  GstPad parent;
  LfFragmentPadSettings settings;
  lf::CameraInput* input;
};

std::vector<lf::PadPtr> lf_fragment_camera_pads(LfFragment* self);
// Sets the mode of all cameras (stopped, running or finished). If `before` is given, only cameras in this mode change.
void lf_fragment_set_mode(LfFragment* self, lf::CameraFrames::Mode mode,
                          std::optional<lf::CameraFrames::Mode> before = std::nullopt);
// Sends a seek to `time` to all file cameras, because the requests have moved to another time. Several clients may
// report the same seek, with the sequence number `seqnum`; only the first call has an effect. Does not wait for the
// frames.
void lf_fragment_seek_cameras(LfFragment* self, uint64_t time, guint32 seqnum);
// Stores the OpenGL context of the latest camera frame in GPU memory (null: none), so that the renderer can move to a
// context that shares these textures.
void lf_fragment_note_context(LfFragment* self, GstGLContext* context);
// Returns the largest CameraInput::needed_delay() of the live cameras, in nanoseconds; 0 if unknown.
uint64_t lf_fragment_needed_delay(LfFragment* self, uint64_t now);
// Creates a sink pad for a camera, with its CameraInput. The caller must add the pad to the element.
GstPad* lf_fragment_camera_pad_new(LfFragment* self, GstPadTemplate* templ, const gchar* name);
