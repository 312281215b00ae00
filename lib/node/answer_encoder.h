// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "base/memory.h"
#include "render/sum_renderer.h"
#include "view/view.h"
#include "wire/answer_codec.h"

namespace lf {

class ExposureCompensation;
class RequestPlan;
struct RenderOptions;

enum class CodecChoice {
  kAuto,  // 16 bits per value if the compositor is in this process; otherwise JPEG of the requested quality
  kRaw,
  kRaw16,
  kJpeg,  // JPEG of the requested quality, or kRaw if the quality is 0
};

struct Coding {
  wire::Codec codec = wire::Codec::kRaw;
  int quality = 0;  // JPEG quality 1 to 100; 0 for other codecs
  bool operator==(const Coding&) const = default;
};

// Returns the encoding of an answer. `in_process` means that the compositor reads the bytes from memory, so that
// encoding time matters but size does not. `quality` is the JPEG quality of the request, 0 to 100.
Coding choose_coding(CodecChoice codec, bool in_process, int quality);

// Returns the number of empty pixels that cost as much as one more fragment (see sum_tiles()). Splitting a sum into
// fragments only pays if it avoids more empty pixels than that.
size_t spare_pixels(const View& view, wire::Codec codec, bool in_process);

// The photo-consistency sums of all depth hypotheses of a request. They measure how well the cameras agree on each
// hypothesis.
struct RenderedConsistency {
  ByteBuffer unit;  // message with the sums; empty if the request has no hypotheses
  GpuStatus drawing;
  size_t nodes = 0;  // number of depth map nodes, over all hypotheses
  uint64_t ns = 0;   // nanoseconds
};

// The answer to a request: up to three messages in sending order (brightness, photo-consistency sums, pixels), and the
// duration of each step.
struct RenderedAnswer {
  ByteBuffer brightness;  // brightness of the cameras; empty without such a request
  RenderedConsistency trials;
  ByteBuffer bytes;
  size_t fragments = 0;
  // A sum that stays on the GPU, as the payload of the only fragment (kRaw16). `bytes` then ends before the payload.
  // May be null.
  std::shared_ptr<gl::GpuSum> payload;
  GpuStatus drawing;
  // Work of the rendering, in pixels of the bounding rectangle of the sum. Other kinds of blending count as the number
  // of mesh-blended pixels that take equally long.
  size_t pixels = 0;
  // Exposure gains that the images were divided by, or null. Valid until the next call of the renderer.
  const ExposureCompensation* gains = nullptr;
  // Wall-clock durations in nanoseconds. render_ns includes rounding to 8 bits.
  uint64_t prepare_ns = 0, render_ns = 0, encode_ns = 0;
};

// The functions below fill in the bytes, fragments, payload and encode_ns of an answer. `sources` are the images to
// render, in the format of header.family. `memory` is reused for the bytes (see AnswerWriter). The result does not
// depend on options.parallel. Errors are thrown as by AnswerWriter.

// Encodes the sum of plan.sum(), which `sum` has rendered from the sources.
void encode_sum(const wire::AnswerHeader& header, const RequestPlan& plan, std::span<const Source> sources,
                const SumRenderer& sum, const RenderOptions& options, ByteBuffer memory, RenderedAnswer& answer);

// Encodes the unwarped camera pixels that the plan requests, and skips sources without an image. Throws Error for an
// image that does not have the size of its camera or the format of the header.
void encode_pixels(const wire::AnswerHeader& header, const RequestPlan& plan, std::span<const Source> sources,
                   const RenderOptions& options, ByteBuffer memory, RenderedAnswer& answer);

}  // namespace lf
