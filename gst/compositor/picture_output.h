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
#include "render/gl/card_sum.h"
#include "view/view.h"

// What is put out for a request of which something is missing.
typedef enum {
  LF_COMPOSITOR_INCOMPLETE_CONCEAL,
  LF_COMPOSITOR_INCOMPLETE_REPEAT,
  LF_COMPOSITOR_INCOMPLETE_DROP,
} LfCompositorIncomplete;

namespace lf {

// Fixed caps of a picture of width x height pixels out of `downstream`, what is taken there; of the fragments' own
// family where `family` is known; null if there are none. Of a set in this layout that GStreamer has a multiview-mode
// for they have that. YCbCr has the range of cameras, or that of video where
// downstream wants BT.601 so: nobody then has to convert it (GstVideoConverter 1.22 would leave the range as it is).
// The frame rate is that of the requests that come to the pad `request`. In a graphics card's memory where downstream
// takes no other. Owned by the caller.
GstCaps* choose_output_caps(GstCaps* downstream, GstPad* request, PixelFamily family, int width, int height,
                            SetLayout layout);

// Why choose_output_caps() finds no caps, and what to do: a sentence for a person.
struct CapsMismatch {
  bool is_of_size_or_rate = false;  // pictures of another size or rate would be accepted
  std::string text;
};
CapsMismatch explain_mismatch(const GstCaps* downstream, GstPad* request, PixelFamily family, int width, int height);

// Video of this family, or of any family where it is kNone, in any memory. Owned by the caller.
GstCaps* offered_caps(PixelFamily family);

// Whether video of these caps, of all of them, is in a graphics card's memory.
bool is_in_card(const GstCaps* caps);

// The textures that a picture's buffer consists of, mapped to be drawn to as long as this lives.
class CardTextures {
 public:
  // `group`: that they have to be of.
  CardTextures(GstBuffer* picture, const GstVideoInfo& info, gl::ShareGroup group);
  // Waits for what has been begun.
  ~CardTextures();
  CardTextures(const CardTextures&) = delete;
  CardTextures& operator=(const CardTextures&) = delete;

  // False if it does not consist of such, or of others than a sum can be drawn to.
  explicit operator bool() const { return is_mapped_; }
  gl::ShareGroup group() const { return group_; }
  // Has the card begin with the picture of a sum that is there, from this pixel on. False with the reason in `why`.
  bool draw(const Accumulator& sum, const Background& background, int x, int y, std::string& why);
  // Waits for all that was begun. False if it will never be there, with the reason in `why`.
  bool finish(std::string& why);

 private:
  void* put_fence() const;

  const gl::ShareGroup group_;
  GstVideoFrame frame_;
  bool is_mapped_ = false;
  gl::CardPicture picture_;                          // where they are, and how their bytes are laid out
  std::vector<std::shared_ptr<gl::CardSum>> begun_;  // and not waited for: nothing is drawn over them until then
};

// What leaves an lfcompositor: pictures, or partial answers, in caps and memory that downstream agrees on, and the
// picture before, which may stand in for an incomplete one. Posts errors of its element. Streaming thread, but for
// is_pushing(), has_begun() and own_card().
class PictureOutput {
 public:
  explicit PictureOutput(GstAggregator* element) : element_(element), own_card_(GST_ELEMENT(element)) {}
  ~PictureOutput() { stop(); }
  PictureOutput(const PictureOutput&) = delete;
  PictureOutput& operator=(const PictureOutput&) = delete;

  // `partial`: answers leave, not pictures. `request`: the pad that has the frame rate.
  void start(bool partial, GstPad* request);
  void stop();
  // The segment has to be sent again, whatever it is.
  void flush() { segment_ = {}, drop_sheet(); }

  // What the functions of GstAggregatorClass of these names do.
  // `follows`: the view's next requests are for pictures that are accepted downstream.
  void negotiate(bool follows);
  GstFlowReturn update_src_caps(GstCaps* downstream, GstCaps** caps);
  bool negotiated_src_caps(GstCaps* caps);
  bool decide_allocation(GstQuery* query);
  OwnCard& own_card() { return own_card_; }

  // What pictures show from now on of their cameras' weights; nothing without a rig.
  void show(ShownWeights what, std::shared_ptr<const Rig> rig) {
    shown_ = what;
    if (rig_ == rig) return;
    rig_ = std::move(rig);
    overlay_ = {};
  }

  // The picture of what was added for a request, with those of the other views of its set. Null if there is none: *flow
  // says why, and is GST_FLOW_OK where other views are still to come. *dropped becomes true where there will be no
  // picture: another set has begun before all views of this one came, or the picture was requested before the
  // accepted size or rate changed.
  GstBuffer* make_picture(Assembly& assembly, const ViewRequest& request, const Background& background,
                          GstFlowReturn* flow, bool* dropped);
  // Whether the latest picture was made where its sums had been left, on a graphics card.
  bool is_on_card() const { return sheet_.on_card; }
  // Whether views of the request's set have been drawn, and it is not whole yet.
  bool is_drawing(const ViewRequest& request) const { return sheet_.buffer && sheet_.first == first_of_set(request); }
  // What was added for the request as the answer of one node, of the number `node`. Null if there is none; *flow then
  // says why.
  GstBuffer* make_answer(Assembly& assembly, const ViewRequest& request, guint node, CodecChoice codec,
                         GstFlowReturn* flow);
  // What is put out in place of a picture that was made last, as `incomplete` says: that picture, the one before again
  // (kRepeated) or nothing (kDropped). Takes the picture.
  enum class Shown { kPicture, kRepeated, kDropped };
  Shown replace_incomplete(const Assembly& assembly, LfCompositorIncomplete incomplete, GstBuffer** picture);

  // Pictures have the stamps of their requests, in the requests' segment.
  void follow_segment(const GstSegment& requests);
  // Takes the buffer, which is at this time of the segment. `keep`: it may stand in for later ones.
  GstFlowReturn push(GstBuffer* picture, GstClockTime pts, bool keep);
  PixelFamily family() const { return offered_; }  // of the pictures; kNone: not known yet. Any thread
  bool is_pushing() const { return pushing_; }     // downstream may take its time
  bool has_refused() const { return refused_; }    // an error has told why downstream accepts no pictures
  bool has_begun() const { return negotiated_; }
  // The context that downstream's memory for pictures belongs to; null: it is not a card's. Any thread.
  GlContextPtr context() const;

 private:
  GstFlowReturn agree_on(PixelFamily family, int width, int height, SetLayout layout);
  GstFlowReturn refuse_picture();
  GstFlowReturn agree_on_picture(PixelFamily family, const ViewRequest& request);
  GstFlowReturn agree_on_answers(const View& view);
  struct Planes;
  void conceal(const Assembly& assembly, const ViewRequest& request, const Planes& picture);
  bool draw_here(const Assembly& assembly, const ViewRequest& request, const Background& background);
  bool draw_on_card(const Assembly& assembly, const ViewRequest& request, const Background& background);
  void leave_card();
  bool begin_sheet(const ViewRequest& request);
  void set_context(GlContextPtr context);
  bool draw(Assembly& assembly, const ViewRequest& request, const Background& background);
  // The number of the request that the set begins with.
  static uint32_t first_of_set(const ViewRequest& request) {
    return request.sequence - static_cast<uint32_t>(request.place.turn());
  }

  GstAggregator* const element_;
  GstPad* request_ = nullptr;
  bool partial_ = false;
  GstSegment segment_{};                  // the segment that was sent downstream: that of the requests
  GstVideoInfo info_{};                   // the negotiated format of pictures
  std::atomic<bool> negotiated_ = false;  // whether caps were negotiated since the start
  // What the next picture is like, no width: not known yet. Whether downstream takes it, as it is now.
  PixelFamily family_ = PixelFamily::kNone;
  std::atomic<PixelFamily> offered_ = PixelFamily::kNone;  // the latest family_ that was known
  int width_ = 0, height_ = 0;
  SetLayout layout_ = SetLayout::kMono;
  bool agreed_ = false;
  bool refused_ = false;
  bool follows_ = false;  // the view's next requests are for pictures that are accepted downstream
  GlContextPtr context_;  // under the element's object lock
  bool in_card_ = false;  // what was negotiated is in a graphics card's memory, see is_in_card()
  OwnCard own_card_;
  PicturePool pool_;
  // The picture that views of a set are being drawn into.
  struct Sheet {
    GstBuffer* buffer = nullptr;  // null: none
    uint32_t first = 0;           // see first_of_set()
    std::vector<bool> drawn;      // view by view
    bool complete = true;         // all views that were drawn were complete
    bool on_card = true;          // and made on a graphics card
    // The buffer's, while views are drawn there; in front of nothing else that is done with the buffer.
    std::unique_ptr<CardTextures> textures = {};
  } sheet_;
  void drop_sheet() {
    sheet_.textures.reset();
    gst_clear_buffer(&sheet_.buffer);
  }
  ShownWeights shown_ = ShownWeights::kNone;
  std::shared_ptr<const Rig> rig_;
  WeightOverlay overlay_;
  std::shared_ptr<AnswerMemory> memory_ = std::make_shared<AnswerMemory>();  // what partial answers are made in
  bool root_is_near_ = false;          // the compositor that partial answers go to is in this process
  GstBuffer* last_picture_ = nullptr;  // what an incomplete picture may be replaced or mended with
  uint64_t last_rig_ = 0;              // hash of the rig that last_picture_ was made with; 0: not known
  std::atomic<bool> pushing_ = false;
};

}  // namespace lf
