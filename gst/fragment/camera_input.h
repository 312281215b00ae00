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

// What comes to one camera pad of lffragment: which camera it is of, and its frames on their way into the node. Posts
// errors of its element. The pad's streaming thread, but for what says any.
class CameraInput {
 public:
  // `element`: whose pad that is. Both outlive this.
  CameraInput(LfFragment* element, LfFragmentPad* pad, Node& node) : element_(element), pad_(pad), node_(node) {}

  // Any thread.
  const std::shared_ptr<CameraFrames>& frames() const { return frames_; }
  bool is_live() const { return live_; }
  // How old a capture has to be for its frame to be there at clock time `now`; 0: not known.
  uint64_t needed_delay(uint64_t now) const { return arrivals_.needed(frames_->period(), now); }
  // The rig's camera that this is; null: not known yet.
  std::shared_ptr<const Camera> camera() const;

  // Finds out which camera this is: as the pad's property says, else the stream, else the pad's number. Posts an error
  // and returns false if there is none such or another pad has it.
  bool assign();
  // The stream says which camera it is of: its index in the rig.
  void name(CameraIndex camera);
  // Frames are ready before their time.
  void note_paced() { frames_->note_arrival(static_cast<int64_t>(latency_)); }
  bool set_caps(GstCaps* caps);
  // `latency`: nothing where it does not come in real time.
  void start_stream(std::optional<GstClockTime> latency);
  // Takes a buffer, which was captured at the time that its stamps in `segment` say (null: none came).
  GstFlowReturn take(GstBuffer* buffer, const GstSegment* segment);
  // Forgets frames, format and camera. While the streaming thread is out.
  void reset();

 private:
  struct Format {
    bool jpeg = false;  // frames are kept as they come
    GstVideoInfo info{};
  };
  void take_format(const Format& format);
  bool check_size(int width, int height);
  uint64_t capture_time(GstBuffer* buffer, const GstSegment* segment) const;
  void note_arrival(uint64_t captured);
  GstBuffer* spare_pool(GstBuffer* buffer) const;
  GstFlowReturn take_raw(GstBuffer* buffer, uint64_t time);
  GstFlowReturn take_jpeg(GstBuffer* buffer, uint64_t time);

  LfFragment* const element_;
  LfFragmentPad* const pad_;
  Node& node_;
  const std::shared_ptr<CameraFrames> frames_ = std::make_shared<CameraFrames>();
  std::atomic<int64_t> id_ = -1;      // id of the camera in the rig; -1: not known yet
  std::optional<guint> from_stream_;  // the id that the stream says
  std::atomic<bool> live_ = false;    // whether frames come in real time, known from the segment on
  ArrivalWatch arrivals_;             // how late frames arrive; of live streams alone
  GstClockTime latency_ = 0;          // latency that the live stream states
  std::optional<Format> next_;        // format of new caps, until the next frame
  std::optional<Format> format_;
  std::unique_ptr<FrameConverter> converter_;
  std::optional<std::pair<int, int>> jpeg_size_;
  bool warned_damaged_ = false;                // a warning of damaged frames has been posted
  std::optional<std::pair<int, int>> fitted_;  // the size of frames that had the rig's
};

}  // namespace lf

// Properties of a camera pad.
struct LfFragmentPadSettings {
  gint camera = -1;  // id in the rig, -1: told by the stream, else the pad's number
  static lf::PropertyTable<LfFragmentPadSettings>& properties();
};

struct _LfFragmentPad {
  GstPad parent;
  LfFragmentPadSettings settings;
  lf::CameraInput* input;
};

// The camera pads of the element, each with a reference.
std::vector<lf::PadPtr> lf_fragment_camera_pads(LfFragment* self);
// Stops, starts or finishes all cameras; if `before` is given, only if that is their mode.
void lf_fragment_set_mode(LfFragment* self, lf::CameraFrames::Mode mode,
                          std::optional<lf::CameraFrames::Mode> before = std::nullopt);
// Requests go on at another time: seeks the cameras that are not live there, unless another requester has done so for
// the seek with this number. Waits for no frames.
void lf_fragment_seek_cameras(LfFragment* self, uint64_t time, guint32 seqnum);
// A frame is in textures of this context, where it may stay; null: none is.
void lf_fragment_note_context(LfFragment* self, GstGLContext* context);
// How old captures have to be for the live cameras to have them, at clock time `now`; 0: nothing is known of any.
uint64_t lf_fragment_needed_delay(LfFragment* self, uint64_t now);
// A new camera pad, not yet added to the element.
GstPad* lf_fragment_camera_pad_new(LfFragment* self, GstPadTemplate* templ, const gchar* name);
