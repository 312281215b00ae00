// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <memory>
#include <string>
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
#include "render/gl/gpu_sum.h"
#include "view/view.h"

typedef enum {
  LF_COMPOSITOR_INCOMPLETE_CONCEAL,
  LF_COMPOSITOR_INCOMPLETE_REPEAT,
  LF_COMPOSITOR_INCOMPLETE_DROP,
} LfCompositorIncomplete;

namespace lf {

// Chooses fixed caps for pictures of width x height pixels from `downstream`, the accepted caps. Returns null if no
// caps fit (transfer full). `family` is the pixel family (RGB or YCbCr) of the fragments, if known; `request` is the
// pad with the frame rate. Stereo layouts have a multiview-mode in the caps. YCbCr has the range of the cameras, or
// video range if downstream requires it for BT.601, because GstVideoConverter 1.22 would ignore the range. GPU memory
// is chosen only if downstream accepts nothing else.
GstCaps* choose_output_caps(GstCaps* downstream, GstPad* request, PixelFamily family, int width, int height,
                            ViewSetLayout layout);

// Explains to the user why choose_output_caps() fails, and what to do.
struct CapsMismatch {
  bool is_of_size_or_rate = false;  // true if another size or rate would be accepted
  std::string text;
};
CapsMismatch explain_mismatch(const GstCaps* downstream, GstPad* request, PixelFamily family, int width, int height);

// Returns video caps of this family (kNone: any family) in any kind of memory (transfer full).
GstCaps* offered_caps(PixelFamily family);

// Returns true if all structures of the caps are in GPU memory.
bool is_in_gpu(const GstCaps* caps);

// Gives access to the textures of a picture buffer, for drawing rendered views. The access ends with the lifetime of
// this object.
class GlRenderTarget {
 public:
  // `group`: required share group of the textures.
  GlRenderTarget(GstBuffer* picture, const GstVideoInfo& info, gl::ShareGroup group);
  ~GlRenderTarget();
  GlRenderTarget(const GlRenderTarget&) = delete;
  GlRenderTarget& operator=(const GlRenderTarget&) = delete;

  // Returns false if rendered views cannot be drawn to the textures of the buffer.
  explicit operator bool() const { return is_mapped_; }
  gl::ShareGroup group() const { return group_; }
  // Starts drawing a sum at pixel (x, y). Returns false and sets `why` on failure.
  bool draw(const Accumulator& sum, const Background& background, int x, int y, std::string& why);
  // Waits for all draw calls. Returns false and sets `why` if the result of a call is lost.
  bool finish(std::string& why);

 private:
  void* insert_fence() const;

  const gl::ShareGroup group_;
  GstVideoFrame frame_;
  bool is_mapped_ = false;
  gl::GpuPicture picture_;
  std::vector<std::shared_ptr<gl::GpuSum>> undrained_;  // unfinished draw calls; keeps their sums alive
};

// The output side of an lfcompositor. It negotiates caps and memory, and makes the pictures or partial answers. It also
// keeps the previous picture as a replacement for incomplete pictures. Errors are posted for its element. Use from the
// streaming thread, except for is_pushing(), has_begun() and own_gpu().
class PictureOutput {
 public:
  explicit PictureOutput(GstAggregator* element) : element_(element), own_gpu_(GST_ELEMENT(element)) {}
  ~PictureOutput() { stop(); }
  PictureOutput(const PictureOutput&) = delete;
  PictureOutput& operator=(const PictureOutput&) = delete;

  // `partial` means answers instead of pictures. `request` is the pad that determines the frame rate.
  void start(bool partial, GstPad* request);
  void stop();
  // Forces a new segment event and drops the unfinished picture.
  void flush() { segment_ = {}, drop_pending(); }

  // Implementations of the GstAggregatorClass functions. `follows` means that the next requests will match the
  // downstream caps.
  void negotiate(bool follows);
  GstFlowReturn update_src_caps(GstCaps* downstream, GstCaps** caps);
  bool negotiated_src_caps(GstCaps* caps);
  bool decide_allocation(GstQuery* query);
  OwnGpu& own_gpu() { return own_gpu_; }

  // Sets the overlay of the next pictures. There is none without a rig.
  void show(WeightOverlayMode what, std::shared_ptr<const Rig> rig) {
    shown_ = what;
    if (rig_ == rig) return;
    rig_ = std::move(rig);
    overlay_ = {};
  }

  // Adds a view to the picture of its set. Returns the picture of the request if all views of the set are complete,
  // otherwise null. *flow is then GST_FLOW_OK if other views are still missing, and otherwise the error. Sets *dropped
  // to true if a picture will never be complete, because a new set started too early, or because the accepted size or
  // rate has changed since the request.
  GstBuffer* make_picture(Assembly& assembly, const ViewRequest& request, const Background& background,
                          GstFlowReturn* flow, bool* dropped);
  // Returns true if the latest picture was made on the GPU that held its sums.
  bool is_on_gpu() const { return pending_.on_gpu; }
  // Returns true if the set of the request has been started and is not complete.
  bool is_drawing(const ViewRequest& request) const {
    return pending_.buffer && pending_.first == first_of_set(request);
  }
  // Returns the sum for the request, as the answer of node number `node`. Returns null on failure and sets *flow.
  GstBuffer* make_answer(Assembly& assembly, const ViewRequest& request, guint node, CodecChoice codec,
                         GstFlowReturn* flow);
  // Applies the property `incomplete` to an incomplete picture: keeps the picture, repeats the previous picture, or
  // outputs none. Takes the picture.
  enum class OutputAction { kPicture, kRepeated, kDropped };
  OutputAction replace_incomplete(const Assembly& assembly, LfCompositorIncomplete incomplete, GstBuffer** picture);

  // Uses the segment of the requests for the output.
  void follow_segment(const GstSegment& requests);
  // Pushes the buffer (transfer full) with the position `pts` in the segment. If `keep`, keeps a reference as a
  // replacement for later pictures.
  GstFlowReturn push(GstBuffer* picture, GstClockTime pts, bool keep);
  PixelFamily family() const { return offered_; }  // kNone: not known yet. Any thread
  bool is_pushing() const { return pushing_; }
  bool has_refused() const { return refused_; }
  bool has_begun() const { return negotiated_; }
  // Returns the OpenGL context of downstream's GPU memory; null for system memory. Any thread.
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
  // Format of the next picture, and whether downstream accepts it (agreed_). Width 0: not known yet.
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
  struct PendingPicture {
    GstBuffer* buffer = nullptr;
    uint32_t first = 0;
    std::vector<bool> drawn;
    bool complete = true;
    bool on_gpu = true;
    // The textures of the buffer while views are drawn on the GPU. Reset this before any other access to the buffer.
    std::unique_ptr<GlRenderTarget> textures = {};
  } pending_;
  void drop_pending() {
    pending_.textures.reset();
    gst_clear_buffer(&pending_.buffer);
  }
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
