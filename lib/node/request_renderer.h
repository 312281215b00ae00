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
#include "focus/exposure_compensation.h"
#include "image/image.h"
#include "node/answer_encoder.h"
#include "node/request_plan.h"
#include "render/gl/context.h"
#include "rig/camera_source.h"
#include "view/view_request.h"
#include "wire/fragment_codec.h"

namespace lf {

namespace gl {
class GlesRenderer;
}

// Processed images of one answer, indexed like the images of the answer. Each buffer has the size of the camera's
// image.
struct ImageMemory {
  std::vector<ByteBuffer> corrected, matched, sharpened;

  // Bytes of all buffers, for MemoryPool.
  size_t size() const;
  size_t capacity() const;
  void clear();
};

// One object per concurrent answer.
using KeptImages = MemoryPool<ImageMemory>;

// Exposure gains of a node's cameras, estimated per view, because brightness depends on the viewpoint. Not thread-safe.
class GainMatcher {
 public:
  static constexpr size_t kMaxViews = 64;  // the least recently used view is forgotten

  // Returns the gains for a request's images, updated if the request carries the mean for the stored measurement. A new
  // view starts with the gains of the latest view.
  const ExposureCompensation& gains_for(uint32_t view_id, const GainRequest& request);
  // Stores the measurement of a request until its mean arrives.
  void keep(uint32_t view_id, uint32_t sequence, std::vector<WideLuma::Camera> seen);

  // Returns the images divided by `gains` inside `region` of each camera (empty region: unchanged). Results are stored
  // in `memory`.
  static std::vector<Source> match(std::span<const Source> sources, const ExposureCompensation& gains,
                                   const std::function<Rect(CameraIndex)>& region, std::vector<ByteBuffer>& memory,
                                   const ParallelFor& parallel = serial_for);
  void clear();
  // Copies the latest gains as the start value of new views.
  void copy_gains_from(const GainMatcher& other) { latest_ = other.latest_; }

 private:
  struct View {
    ExposureCompensation gains;
    uint32_t sequence = 0;  // belongs to `seen`
    std::vector<WideLuma::Camera> seen;
    uint64_t used = 0;
  };
  View& view_of(uint32_t view_id);

  std::map<uint32_t, View> views_;
  ExposureCompensation latest_;
  uint64_t uses_ = 0;
};

struct RenderOptions {
  CodecChoice codec = CodecChoice::kAuto;
  bool in_process = false;                // the compositor runs in this process: see choose_coding()
  int strip_pixels = wire::kStripPixels;  // largest 8-bit fragment, pixels
  Resampling resampling = Resampling::kBilinear;
  const RigColourCorrections* colours = nullptr;  // colour corrections of the plan's rig; null: none
  std::shared_ptr<gl::GlesRenderer> gpu;          // draws sums if possible; null: CPU only
  std::shared_ptr<gl::GlesRenderer> depth_gpu;    // computes photo-consistency sums: see add_consistency()
  // Share group of the pictures of a compositor in this process; sums drawn in this group may stay on the GPU. 0: none.
  gl::ShareGroup group = 0;
  ParallelFor parallel = serial_for;
};

// Renders planned requests from images of a node's cameras. Prepares the images (colour correction, exposure gains,
// sharpening), draws the sums, and encodes the answers. Keeps the exposure gains of one client's views. Not
// thread-safe.
class RequestRenderer {
 public:
  struct Work {
    const RequestPlan* plan;
    wire::AnswerHeader header;
    // False: no camera of the plan has an image, and the answer is empty instead of missing weight.
    bool has_images = true;
  };
  // Returns the answers to several requests that use the same images. Brightness is measured only for a single request.
  // Each answer is independent of the remaining requests and of options.parallel. A GPU draws as many views per pass as
  // it can.
  //
  // `images`: images of all cameras of the plans, ascending, of one family; an image of kNone counts as missing weight.
  // `scratch`: storage for the prepared images. `memory`: provides recycled memory for one answer. Throws Error if an
  // image does not have its camera's size, and as AnswerWriter does.
  std::vector<RenderedAnswer> render(std::span<const Work> works, std::span<const Source> images,
                                     const RenderOptions& options, ImageMemory& scratch,
                                     const std::function<ByteBuffer()>& memory);
  RenderedAnswer render(const Work& work, std::span<const Source> images, const RenderOptions& options,
                        ImageMemory& scratch, ByteBuffer memory = {});
  void clear() { gains_.clear(); }
  void copy_gains_from(const RequestRenderer& other) { gains_.copy_gains_from(other.gains_); }

 private:
  void match_gains(std::span<const Work> works, const RenderOptions& options, std::vector<ByteBuffer>& memory,
                   std::vector<Source>& images, std::vector<RenderedAnswer>& answers);

  GainMatcher gains_;
};

}  // namespace lf
