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
// caps fit (transfer full). `family`: of the fragments, if known. `request`: the pad with the frame rate. A layout with
// a GStreamer multiview-mode has this mode in the caps. YCbCr has the cameras' range, or video range if downstream
// requires it for BT.601; GstVideoConverter 1.22 would ignore the range. Uses GPU memory only if downstream accepts
// nothing else.
GstCaps* choose_output_caps(GstCaps* downstream, GstPad* request, PixelFamily family, int width, int height,
                            ViewSetLayout layout);

// The reason why choose_output_caps() fails, and the remedy, for the user.
struct CapsMismatch {
  bool is_of_size_or_rate = false;  // true if another size or rate would be accepted
  std::string text;
};
CapsMismatch explain_mismatch(const GstCaps* downstream, GstPad* request, PixelFamily family, int width, int height);

// Returns video caps of this family (kNone: any family) in any memory (transfer full).
GstCaps* offered_caps(PixelFamily family);

// True if all structures of the caps are in GPU memory.
bool is_in_gpu(const GstCaps* caps);

// The textures of a picture buffer, mapped as a render target during the object's lifetime.
class GlRenderTarget {
 public:
  // `group`: required share group of the textures.
  GlRenderTarget(GstBuffer* picture, const GstVideoInfo& info, gl::ShareGroup group);
  ~GlRenderTarget();
  GlRenderTarget(const GlRenderTarget&) = delete;
  GlRenderTarget& operator=(const GlRenderTarget&) = delete;

  // False if sums cannot be drawn to the textures of the buffer.
  explicit operator bool() const { return is_mapped_; }
  gl::ShareGroup group() const { return group_; }
  // Starts drawing a sum at pixel (x, y). Returns false and sets `why` on failure.
  bool draw(const Accumulator& sum, const Background& background, int x, int y, std::string& why);
  // Waits for all draw calls. Returns false and sets `why` if a result is lost.
  bool finish(std::string& why);

 private:
  void* insert_fence() const;

  const gl::ShareGroup group_;
  GstVideoFrame frame_;
  bool is_mapped_ = false;
  gl::GpuPicture picture_;
  std::vector<std::shared_ptr<gl::GpuSum>> undrained_;  // unfinished draw calls; keeps their sums alive
};

// The output of an lfcompositor: negotiates caps and memory, makes pictures or partial answers, and keeps the previous
// picture as a replacement for incomplete pictures. Posts errors of its element. Use from the streaming thread, except
// for is_pushing(), has_begun() and own_gpu().
class PictureOutput {
 public:
  explicit PictureOutput(GstAggregator* element) : element_(element), own_gpu_(GST_ELEMENT(element)) {}
  ~PictureOutput() { stop(); }
  PictureOutput(const PictureOutput&) = delete;
  PictureOutput& operator=(const PictureOutput&) = delete;

  // `partial`: output answers instead of pictures. `request`: the pad that determines the frame rate.
  void start(bool partial, GstPad* request);
  void stop();
  // Forces a new segment event and drops the unfinished picture.
  void flush() { segment_ = {}, drop_pending(); }

  // Implementations of the GstAggregatorClass functions. `follows`: the view's next requests will match the downstream
  // caps.
  void negotiate(bool follows);
  GstFlowReturn update_src_caps(GstCaps* downstream, GstCaps** caps);
  bool negotiated_src_caps(GstCaps* caps);
  bool decide_allocation(GstQuery* query);
  OwnGpu& own_gpu() { return own_gpu_; }

  // Sets the overlay of the next pictures; none without a rig.
  void show(WeightOverlayMode what, std::shared_ptr<const Rig> rig) {
    shown_ = what;
    if (rig_ == rig) return;
    rig_ = std::move(rig);
    overlay_ = {};
  }

  // Returns the picture of a request and all views of its set. Returns null if there is none; *flow is GST_FLOW_OK if
  // other views are still missing, otherwise the error. Sets *dropped to true if a picture will never be complete: a
  // new set started too early, or the request precedes a change of the accepted size or rate.
  GstBuffer* make_picture(Assembly& assembly, const ViewRequest& request, const Background& background,
                          GstFlowReturn* flow, bool* dropped);
  // True if the latest picture was made on the GPU that held its sums.
  bool is_on_gpu() const { return pending_.on_gpu; }
  // True if the request's set has been started and is not complete.
  bool is_drawing(const ViewRequest& request) const {
    return pending_.buffer && pending_.first == first_of_set(request);
  }
  // Returns the sum for the request as the answer of node `node`. Returns null on failure and sets *flow.
  GstBuffer* make_answer(Assembly& assembly, const ViewRequest& request, guint node, CodecChoice codec,
                         GstFlowReturn* flow);
  // Keeps, repeats or drops an incomplete picture, according to `incomplete`. Takes the picture.
  enum class OutputAction { kPicture, kRepeated, kDropped };
  OutputAction replace_incomplete(const Assembly& assembly, LfCompositorIncomplete incomplete, GstBuffer** picture);

  // Uses the segment of the requests for the output.
  void follow_segment(const GstSegment& requests);
  // Pushes the buffer (transfer full). `pts`: position in the segment. `keep`: keep a reference as a replacement for
  // later pictures.
  GstFlowReturn push(GstBuffer* picture, GstClockTime pts, bool keep);
  PixelFamily family() const { return offered_; }  // kNone: not known yet. Any thread
  bool is_pushing() const { return pushing_; }     // downstream may block meanwhile
  bool has_refused() const { return refused_; }    // an error has been posted about caps
  bool has_begun() const { return negotiated_; }
  // Returns the context of downstream's GPU memory; null: system memory. Any thread.
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
  GstSegment segment_{};  // sent downstream
  GstVideoInfo info_{};
  std::atomic<bool> negotiated_ = false;
  // Format of the next picture, and whether downstream accepts it (agreed_). Width 0: not known yet.
  PixelFamily family_ = PixelFamily::kNone;
  std::atomic<PixelFamily> offered_ = PixelFamily::kNone;  // latest known family_
  int width_ = 0, height_ = 0;
  ViewSetLayout layout_ = ViewSetLayout::kMono;
  bool agreed_ = false;
  bool refused_ = false;
  bool follows_ = false;  // the view's next requests will match the downstream caps
  GlContextPtr context_;  // guarded by the element's object lock
  bool in_gpu_ = false;   // see is_in_gpu()
  OwnGpu own_gpu_;
  PicturePool pool_;
  // The unfinished picture of a set of views.
  struct PendingPicture {
    GstBuffer* buffer = nullptr;
    uint32_t first = 0;
    std::vector<bool> drawn;
    bool complete = true;  // all drawn views are complete
    bool on_gpu = true;    // all drawn views were made on a GPU
    // The buffer's textures while views are drawn on the GPU; reset before any other access to the buffer.
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
  bool root_is_local_ = false;         // the receiver of partial answers is in this process
  GstBuffer* last_picture_ = nullptr;  // replacement for incomplete pictures
  uint64_t last_rig_ = 0;              // rig hash of last_picture_; 0: unknown
  std::atomic<bool> pushing_ = false;
};

}  // namespace lf
