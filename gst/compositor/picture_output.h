// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <memory>
#include <utility>
#include <vector>

#include <gst/base/gstaggregator.h>
#include <gst/gst.h>
#include <gst/video/video.h>

#include "common/custom_events.h"
#include "common/gst_wire.h"
#include "composite/accumulator.h"
#include "composite/assembly.h"
#include "composite/view_weights.h"
#include "compositor/picture_pool.h"
#include "image/image.h"
#include "node/answer_encoder.h"
#include "view/view.h"

// Values of the property `incomplete`, which selects the output of lfcompositor if parts of a picture are missing.
typedef enum {
  // Shows the incomplete picture. Pixels that lack most of their weight come from the previous picture.
  LF_COMPOSITOR_INCOMPLETE_CONCEAL,
  // Outputs the previous picture again.
  LF_COMPOSITOR_INCOMPLETE_REPEAT,
  // Outputs nothing.
  LF_COMPOSITOR_INCOMPLETE_DROP,
} LfCompositorIncomplete;

namespace lf {

// Returns the video caps that the compositor can produce for this pixel family (kNone: for any family), in system
// memory and in GPU memory. The caller owns the caps.
GstCaps* offered_caps(PixelFamily family);

// Returns true if all structures of the caps are in GPU memory.
bool is_in_gpu(const GstCaps* caps);

class GlRenderTarget;

// The output side of an lfcompositor: negotiates caps and memory with downstream, makes the pictures, and pushes each
// picture. If the compositor is part of a tree (partial=true), it makes the answer for the next compositor instead of a
// picture. The class keeps the previous picture, which replaces an incomplete picture or fills its gaps. It posts
// errors as messages of its element. Use it from the streaming thread, except for is_pushing(), has_begun(), own_gpu(),
// family() and context().
class PictureOutput {
 public:
  explicit PictureOutput(GstAggregator* element);
  ~PictureOutput();
  PictureOutput(const PictureOutput&) = delete;
  PictureOutput& operator=(const PictureOutput&) = delete;

  // Prepares the class for a new stream. If `partial` is true, the output consists of answers instead of pictures. The
  // frame rate of the output is taken from the caps of the pad `request`.
  void start(bool partial, GstPad* request);
  void stop();
  // Call this after a flush. The next output starts with a new segment event, and a half-drawn picture is dropped.
  void flush() { segment_ = {}, drop_pending(); }

  // Implement the GstAggregatorClass functions of the same names. `follows` means that lfviewrequest has received the
  // caps of downstream and will adapt its next requests, so a mismatch of size or rate is only temporary and no error.
  void negotiate(bool follows);
  GstFlowReturn update_src_caps(GstCaps* downstream, GstCaps** caps);
  bool negotiated_src_caps(GstCaps* caps);
  bool decide_allocation(GstQuery* query);
  OwnGpu& own_gpu() { return own_gpu_; }

  // Selects the overlay that is drawn on the next pictures, for example the camera mesh. Without a rig, no overlay is
  // drawn.
  void show(WeightOverlayMode what, std::shared_ptr<const Rig> rig) {
    shown_ = what;
    if (rig_ == rig) return;
    rig_ = std::move(rig);
    overlay_ = {};
  }

  // Draws the view of one request into the current picture. A picture contains all views of a set, such as a stereo
  // pair. Returns the finished picture, which the caller owns, when the last view of the set has been drawn. Otherwise
  // returns null, and *flow is GST_FLOW_OK if further views are expected, or an error. Sets *dropped to true if a
  // picture will never be complete. This happens if the next set starts too early, or if downstream now accepts only
  // another size or rate.
  GstBuffer* make_picture(Assembly& assembly, const ViewRequest& request, const Background& background,
                          GstFlowReturn* flow, bool* dropped);
  // Returns true if the GPU made the latest picture, so that no pixels were downloaded.
  bool is_on_gpu() const { return pending_.on_gpu; }
  // Returns true if other views of the request's set have been drawn, and the picture of this set is not complete yet.
  bool is_drawing(const ViewRequest& request) const {
    return pending_.buffer && pending_.first == first_of_set(request);
  }
  // Encodes the sum of all received answers as one answer from a node with the number `node`, for the next compositor
  // of a tree. The caller owns the result. Returns null on failure and sets *flow.
  GstBuffer* make_answer(Assembly& assembly, const ViewRequest& request, guint node, CodecChoice codec,
                         GstFlowReturn* flow);
  // Applies the property `incomplete` to the picture that make_picture() has returned. If parts of the picture are
  // missing, the function either keeps *picture, replaces it by a copy of the previous picture, or frees it and sets it
  // to null. The result says which of the three happened.
  enum class OutputAction { kPicture, kRepeated, kDropped };
  OutputAction replace_incomplete(const Assembly& assembly, LfCompositorIncomplete incomplete, GstBuffer** picture);

  // Sends the segment of the requests downstream, so that the timestamps of requests and pictures have the same
  // meaning.
  void follow_segment(const GstSegment& requests);
  // Pushes a picture or answer, and takes its reference. `pts` becomes the position of the output segment. If `keep` is
  // true, the picture is also stored as the replacement for later incomplete pictures.
  GstFlowReturn push(GstBuffer* picture, GstClockTime pts, bool keep);
  PixelFamily family() const { return offered_; }  // kNone: not known yet. Any thread
  bool is_pushing() const { return pushing_; }
  bool has_refused() const { return refused_; }
  bool has_begun() const { return negotiated_; }
  // Returns the OpenGL context of the textures that pictures are drawn into, or null if pictures are in system memory.
  // Any thread.
  GlContextPtr context() const;

 private:
  GstFlowReturn negotiate_caps(PixelFamily family, int width, int height, ViewSetLayout layout);
  GstFlowReturn refuse_picture();
  GstFlowReturn negotiate_picture(PixelFamily family, const ViewRequest& request);
  GstFlowReturn negotiate_answers(const View& view);
  struct Planes;
  void conceal(const Assembly& assembly, const ViewRequest& request, const Planes& picture);
  bool draw_here(const Assembly& assembly, const ViewRequest& request, const Background& background);
  bool draw_on_gpu(const Assembly& assembly, const ViewRequest& request, const Background& background);
  void leave_gpu();
  bool begin_pending(const ViewRequest& request);
  void set_context(GlContextPtr context);
  bool draw(Assembly& assembly, const ViewRequest& request, const Background& background);
  static uint32_t first_of_set(const ViewRequest& request) {
    return request.sequence - static_cast<uint32_t>(request.place.turn());
  }

  GstAggregator* const element_;
  GstPad* request_ = nullptr;
  bool partial_ = false;
  GstSegment segment_{};
  GstVideoInfo info_{};
  std::atomic<bool> negotiated_ = false;
  // The format of the next picture, which update_src_caps() offers. `agreed_` is true if downstream accepts the format.
  // The width is 0 until the first picture.
  PixelFamily family_ = PixelFamily::kNone;
  std::atomic<PixelFamily> offered_ = PixelFamily::kNone;
  int width_ = 0, height_ = 0;
  ViewSetLayout layout_ = ViewSetLayout::kMono;
  bool agreed_ = false;
  bool refused_ = false;
  bool follows_ = false;  // the view's next requests will match the downstream caps
  GlContextPtr context_;
  bool in_gpu_ = false;
  OwnGpu own_gpu_;
  PicturePool pool_;
  // The picture of a set of views that is being drawn. `first` is the sequence number of the set's first request, and
  // `drawn` tells for each view whether it has been drawn.
  struct PendingPicture {
    GstBuffer* buffer = nullptr;
    uint32_t first = 0;
    std::vector<bool> drawn;
    bool complete = true;
    bool on_gpu = true;
    // The textures of the buffer, while the GPU draws views into the buffer. Call leave_gpu() before any other access
    // to the buffer.
    std::shared_ptr<GlRenderTarget> textures = {};
  } pending_;
  void drop_pending();
  WeightOverlayMode shown_ = WeightOverlayMode::kNone;
  std::shared_ptr<const Rig> rig_;
  WeightOverlay overlay_;
  std::shared_ptr<AnswerMemory> memory_ = std::make_shared<AnswerMemory>();
  bool root_is_local_ = false;  // the receiver of partial answers is in this process
  GstBuffer* last_picture_ = nullptr;
  uint64_t last_rig_ = 0;  // rig hash of last_picture_; 0: unknown
  std::atomic<bool> pushing_ = false;
};

}  // namespace lf
