// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/memory.h"
#include "base/worker_pool.h"
#include "depth/array_depth.h"
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

// Reusable memory for the processed images of one answer: after colour correction, after exposure compensation, and
// after sharpening. Each vector has the same indices as the images, and each buffer has the size of the camera's image.
struct ImageMemory {
  std::vector<ByteBuffer> corrected, matched, sharpened;

  size_t size() const;
  size_t capacity() const;
  void clear();
};

// One ImageMemory is taken from the pool for each concurrent answer.
using KeptImages = MemoryPool<ImageMemory>;

// Exposure compensation of one view on a node: finds the gain of each camera (1.1 means 10 % too bright), and divides
// its images by the gain. The node measures the brightness of its cameras, and a later request brings the mean
// brightness of all nodes, which the measurement is compared with. Each view has its own gains, because the brightness
// of a surface depends on the viewpoint. A plain value without locks.
class GainMatcher {
 public:
  // Returns the exposure gains for the images of a request. If the request contains the mean luma for a measurement
  // that keep() has stored, these two values first update the gains.
  const ExposureCompensation& gains_for(const GainRequest& request);
  // Stores the node's brightness measurement for a request, until a later request brings the mean over all nodes.
  void keep(uint32_t sequence, std::vector<WideLuma::Camera> seen);

  // Returns the images divided by `gains` inside the `region` of each camera; an image with an empty region stays
  // unchanged. The results are stored in `memory`.
  static std::vector<Source> match(std::span<const Source> sources, const ExposureCompensation& gains,
                                   const std::function<Rect(CameraIndex)>& region, std::vector<ByteBuffer>& memory,
                                   const ParallelFor& parallel = serial_for);
  void copy_gains_from(const GainMatcher& other) { gains_ = other.gains_; }

 private:
  ExposureCompensation gains_;
  uint32_t sequence_ = 0;  // number of the request that measured seen_
  std::vector<WideLuma::Camera> seen_;
};

struct RenderOptions {
  CodecChoice codec = CodecChoice::kAuto;
  bool in_process = false;                // the compositor runs in this process; see choose_coding()
  int strip_pixels = wire::kStripPixels;  // size of the largest 8-bit fragment, pixels
  Resampling resampling = Resampling::kBilinear;
  const RigColourCorrections* colours = nullptr;  // colour corrections of the plan's rig, or null
  std::shared_ptr<gl::GlesRenderer> gpu;          // renders sums if it can; null: CPU only
  std::shared_ptr<gl::GlesRenderer> depth_gpu;    // computes photo-consistency sums; see add_consistency()
  // Share group of a compositor in this process, or 0. Sums rendered in this group may stay on the GPU.
  gl::ShareGroup group = 0;
  ParallelFor parallel = serial_for;
};

// Makes the answers to planned requests from the images of a node's cameras. Steps: prepare the images (colour
// correction, exposure compensation, sharpening), render the weighted sums, and encode the answers. It keeps
// only the exposure gains of the client's view between requests. Not thread-safe.
class RequestRenderer {
 public:
  struct Work {
    const RequestPlan* plan;
    wire::AnswerHeader header;
    // Returns false if no camera of the plan has an image. The answer is then empty instead of reporting missing
    // weight.
    bool has_images = true;
    // The surface that the cameras have measured, warped to RequestPlan::measured_view(), or null; and how much it
    // counts beside the surfaces of other nodes, 0 to 1.
    std::shared_ptr<const FocalMap> measured = {};
    float measured_weight = 1;
    // The depths of the cameras, or nothing. If the cameras have measured the surface of the view, the depths tell
    // which cameras see it.
    std::optional<ArrayDepth> depths = {};
  };
  // Answers several requests that use the same images. A GPU renders several views per pass. Each answer is the same as
  // for its request alone, for any options.parallel. Brightness is only measured if there is a single request.
  //
  // `images` holds the images of all cameras of the plans in ascending order, in one family. An image of kNone counts
  // as missing weight. `scratch` stores the prepared images, and `memory` returns reusable memory for one answer.
  // Throws Error if an image does not have the size of its camera, and as AnswerWriter does.
  std::vector<RenderedAnswer> render(std::span<const Work> works, std::span<const Source> images,
                                     const RenderOptions& options, ImageMemory& scratch,
                                     const std::function<ByteBuffer()>& memory);
  RenderedAnswer render(const Work& work, std::span<const Source> images, const RenderOptions& options,
                        ImageMemory& scratch, ByteBuffer memory = {});
  void clear() { gains_ = {}; }
  void copy_gains_from(const RequestRenderer& other) { gains_.copy_gains_from(other.gains_); }

 private:
  void match_gains(std::span<const Work> works, const RenderOptions& options, std::vector<ByteBuffer>& memory,
                   std::vector<Source>& images, std::vector<RenderedAnswer>& answers);

  GainMatcher gains_;
};

}  // namespace lf
