// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "base/memory.h"
#include "base/worker_pool.h"
#include "focus/camera_gains.h"
#include "image/image.h"
#include "node/answer_encoder.h"
#include "node/request_plan.h"
#include "render/gl/context.h"
#include "rig/camera_source.h"
#include "view/view_request.h"
#include "wire/fragment_codec.h"

namespace lf {

namespace gl {
class SumDrawer;
}

// Memory for the processed images of one answer, by the index of the image in the answer. Each has the size of the
// camera's image.
struct ImageMemory {
  std::vector<ByteBuffer> corrected, matched, sharpened;

  // Bytes of all of them, as KeptMemory asks.
  size_t size() const;
  size_t capacity() const;
  void clear();
};

// Image memory that answers reuse: one for each answer that is made at the same time.
using KeptImages = KeptMemory<ImageMemory>;

// The gains of a node's cameras, found view by view: what a camera shows depends on where it looks from, and views
// differ in what they make of it. Not thread-safe.
class GainMatcher {
 public:
  static constexpr size_t kMostViews = 64;  // with more views those asked for longest ago are forgotten

  // The gains that a request's images are to be divided by, once its mean has told about the cameras that were seen for
  // it. A view that is new begins with what the one before came to.
  const CameraGains& gains_for(uint32_t view_id, const GainRequest& request);
  // Keeps what was seen for a request until its mean comes.
  void keep(uint32_t view_id, uint32_t sequence, std::vector<WideLuma::Camera> seen);

  // The images divided by `gains` where they are in `region` of a camera (empty: as they are), in `memory`.
  static std::vector<Source> match(std::span<const Source> sources, const CameraGains& gains,
                                   const std::function<Rect(CameraIndex)>& region, std::vector<ByteBuffer>& memory,
                                   const ParallelFor& parallel = serial_for);
  void clear();
  // New views begin with what the other matcher's latest view came to.
  void begin_like(const GainMatcher& other) { latest_ = other.latest_; }

 private:
  struct View {
    CameraGains gains;
    uint32_t sequence = 0;  // number of the request that `seen` is of
    std::vector<WideLuma::Camera> seen;
    uint64_t used = 0;
  };
  View& view_of(uint32_t view_id);

  std::map<uint32_t, View> views_;
  CameraGains latest_;
  uint64_t uses_ = 0;
};

// How requests are rendered, as far as the node may choose.
struct RenderOptions {
  CodecChoice codec = CodecChoice::kAuto;
  bool in_process = false;                // the compositor is in this process: see choose_coding()
  int strip_pixels = wire::kStripPixels;  // most pixels of a fragment in 8 bits
  Resampling resampling = Resampling::kBilinear;
  const CameraColours* colours = nullptr;     // the colours of the plan's rig; null: colours are taken as they come
  std::shared_ptr<gl::SumDrawer> card;        // draws the sums, where it can; null: the CPU does
  std::shared_ptr<gl::SumDrawer> trial_card;  // adds up the moments of trials: see add_moments()
  // A compositor in this process makes its pictures in textures of these contexts, so that what is drawn in one of
  // them may stay on the card; 0: it does not.
  gl::ShareGroup group = 0;
  ParallelFor parallel = serial_for;
};

// Renders requests that are planned out of images of a node's cameras: makes the images ready (their colours corrected,
// their brightness matched, sharpened), draws what the plans ask for, and encodes that into answers. It keeps what it
// learns of one requester's views. Not thread-safe.
class RequestRenderer {
 public:
  // A request that is to be rendered.
  struct Work {
    const RequestPlan* plan;
    wire::AnswerHeader header;
    bool has_images = true;  // false: none of its cameras has one, and what they would show is nothing, not lost
  };
  // The answers to several requests whose images are the same; of more than one none asks how bright cameras are. What
  // one comes to does not depend on the others, nor on options.parallel; a card draws as many as it can in a pass.
  // `images`: of all cameras of the plans, ascending, of one family; one without an image (kNone) is lost weight.
  // `scratch`: holds the images that are made ready. `memory`: to be recycled for one answer. Throws Error for images
  // that are not of their camera's size, and as AnswerWriter.
  std::vector<RenderedAnswer> render(std::span<const Work> works, std::span<const Source> images,
                                     const RenderOptions& options, ImageMemory& scratch,
                                     const std::function<ByteBuffer()>& memory);
  // The answer to one.
  RenderedAnswer render(const Work& work, std::span<const Source> images, const RenderOptions& options,
                        ImageMemory& scratch, ByteBuffer memory = {});
  void clear() { gains_.clear(); }
  // New views begin with what the other renderer has learned.
  void begin_like(const RequestRenderer& other) { gains_.begin_like(other.gains_); }

 private:
  void match_gains(std::span<const Work> works, const RenderOptions& options, std::vector<ByteBuffer>& memory,
                   std::vector<Source>& images, std::vector<RenderedAnswer>& answers);

  GainMatcher gains_;
};

}  // namespace lf
