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

// Returns the number of empty pixels that take as long to send as one more fragment (see sum_tiles()). A sum is only
// worth splitting into two fragments if this avoids more empty pixels than that number.
size_t spare_pixels(const View& view, wire::Codec codec, bool in_process);

// The photo-consistency sums of all depth hypotheses of a request.
struct RenderedConsistency {
  ByteBuffer unit;  // message with the sums; empty if the request has no hypotheses
  GpuStatus drawing;
  size_t nodes = 0;  // number of depth map nodes, over all hypotheses
  uint64_t ns = 0;   // nanoseconds
};

// The answer to a request. It consists of up to three messages in sending order (the brightness of the cameras, the
// photo-consistency sums, and the pixels) and the duration of each step.
struct RenderedAnswer {
  ByteBuffer brightness;  // brightness of the cameras; empty without such a request
  RenderedConsistency consistency;
  ByteBuffer bytes;
  size_t fragments = 0;
  // The sum (the weighted total of the node's cameras), if it stays on the GPU. It is then the payload of the only
  // fragment, in the format kRaw16, and `bytes` ends before the payload. Otherwise null.
  std::shared_ptr<gl::GpuSum> payload;
  GpuStatus drawing;
  // The work of rendering, as a number of pixels, for predicting how long later answers take. It is the area of the
  // bounding rectangle of the sum. Other kinds of blending count as the number of mesh-blended pixels that take equally
  // long.
  size_t pixels = 0;
  // The exposure gains that the images were divided by, or null without exposure compensation. Valid until the next
  // call of the renderer.
  const ExposureCompensation* gains = nullptr;
  // Wall-clock durations in nanoseconds. render_ns includes rounding to 8 bits.
  uint64_t prepare_ns = 0, render_ns = 0, encode_ns = 0;
};

// The functions below fill in the bytes, fragments, payload and encode_ns of an answer. `sources` are the images to
// render, in the format of header.family. `memory` is reused for the bytes (see AnswerWriter). The result does not
// depend on options.parallel. Errors are thrown as by AnswerWriter.

// Encodes the weighted total of the cameras that plan.sum() describes. `sum` has rendered it from the sources.
void encode_sum(const wire::AnswerHeader& header, const RequestPlan& plan, std::span<const Source> sources,
                const SumRenderer& sum, const RenderOptions& options, ByteBuffer memory, RenderedAnswer& answer);

// Encodes the original pixels of the camera images that the plan requests, for a compositor that renders the view
// itself. Sources without an image are skipped. Throws Error for an image that does not have the size of its camera or
// the format of the header.
void encode_pixels(const wire::AnswerHeader& header, const RequestPlan& plan, std::span<const Source> sources,
                   const RenderOptions& options, ByteBuffer memory, RenderedAnswer& answer);

}  // namespace lf
