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
  kAuto,   // 16 bits per value within a process; over links JPEG of the requested quality
  kRaw,    // 8 bits per value
  kRaw16,  // 16 bits per value
  kJpeg,   // JPEG of the requested quality; raw if that is 0
};

struct Coding {
  wire::Codec codec = wire::Codec::kRaw;
  int quality = 0;  // JPEG quality, 1 to 100; otherwise 0
  bool operator==(const Coding&) const = default;
};

// `in_process`: the compositor uses the bytes in place, so that size does not matter but encoding time does. `quality`:
// JPEG quality of the request, 0 to 100.
Coding choose_coding(CodecChoice codec, bool in_process, int quality);

// Number of empty pixels that cost as much as one more fragment: see sum_tiles().
size_t spare_pixels(const View& view, wire::Codec codec, bool in_process);

// The photo-consistency sums of all depth hypotheses of a request.
struct RenderedConsistency {
  ByteBuffer unit;  // photo-consistency unit; empty: no hypotheses
  GpuStatus drawing;
  size_t nodes = 0;  // nodes of all hypotheses
  uint64_t ns = 0;   // nanoseconds
};

// The answer to a request: up to three units of the answer stream, in sending order, and the duration of each step.
struct RenderedAnswer {
  ByteBuffer brightness;  // photo-consistency unit; empty: the request does not ask for brightness
  RenderedConsistency trials;
  ByteBuffer bytes;
  size_t fragments = 0;
  // A sum that stays on the GPU: the payload of the only fragment, kRaw16. `bytes` then ends before the payload. May be
  // null.
  std::shared_ptr<gl::GpuSum> payload;
  GpuStatus drawing;
  // Pixels of the bounding rectangle of the sum. Without a mesh, the number of mesh-blended pixels that take equally
  // long.
  size_t pixels = 0;
  // Exposure gains that the images were divided by, valid until the renderer's next call; null: not divided.
  const ExposureCompensation* gains = nullptr;
  // Wall times in nanoseconds. render_ns includes rounding to 8 bits.
  uint64_t prepare_ns = 0, render_ns = 0, encode_ns = 0;
};

// The functions below write the bytes, fragments, payload and encode_ns of an answer. `sources`: the images to draw, of
// the family header.family. `memory` is recycled (see AnswerWriter). The result does not depend on options.parallel.
// Throw Error like AnswerWriter.

// Encodes the part of the view that the sources contribute to. `sum`: the sum of plan.sum(), drawn from the sources.
void encode_sum(const wire::AnswerHeader& header, const RequestPlan& plan, std::span<const Source> sources,
                const SumRenderer& sum, const RenderOptions& options, ByteBuffer memory, RenderedAnswer& answer);

// Encodes the unwarped pixels that the plan requests. Skips sources without an image. Throws Error for images of
// another size than their camera or another family than the header.
void encode_pixels(const wire::AnswerHeader& header, const RequestPlan& plan, std::span<const Source> sources,
                   const RenderOptions& options, ByteBuffer memory, RenderedAnswer& answer);

}  // namespace lf
