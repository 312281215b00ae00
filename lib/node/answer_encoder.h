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

// Values of the property `codec` of lffragment and lfcompositor, which selects the encoding of the pixels in answers.
enum class CodecChoice {
  kAuto,  // 16 bits per value if the compositor is in this process; otherwise JPEG of the requested quality
  kRaw,
  kRaw16,
  kJpeg,  // JPEG of the requested quality, or kRaw if the quality is 0
};

// The encoding of one answer, which choose_coding() derives from the property and the request.
struct Coding {
  wire::Codec codec = wire::Codec::kRaw;
  int quality = 0;  // JPEG quality 1 to 100; 0 for other codecs
  bool operator==(const Coding&) const = default;
};

// Returns the encoding of an answer. `in_process` means that the compositor reads the bytes from memory, so that
// encoding time matters but size does not. `quality` is the JPEG quality of the request, 0 to 100.
Coding choose_coding(CodecChoice codec, bool in_process, int quality);

// Returns the cost of one more fragment, as a number of pixels. The cameras of a node may contribute only to some parts
// of a view, and the pixels between these parts are empty. It is only worth sending the parts as two fragments if this
// saves more empty pixels than the returned number; see sum_tiles(). `in_process` means that the answer is not sent
// over a network.
size_t max_extra_pixels(const View& view, wire::Codec codec, bool in_process);

// The photo-consistency sums of all depth hypotheses of a request. They let the compositor judge which guessed depth is
// right, without images.
struct RenderedConsistency {
  ByteBuffer unit;  // message with the sums; empty if the request has no hypotheses
  GpuStatus drawing;
  size_t nodes = 0;  // number of depth map nodes, over all hypotheses
  uint64_t ns = 0;   // nanoseconds
};

// The answer to a request: up to three messages, which must be sent in the order of the members (the brightness of the
// cameras, the photo-consistency sums, and the pixels). All further members are statistics.
struct RenderedAnswer {
  ByteBuffer brightness;  // brightness of the cameras; empty without such a request
  RenderedConsistency consistency;
  ByteBuffer bytes;
  size_t fragments = 0;
  // The pixels of the answer (the weighted sum of the node's cameras), if they stay on the GPU; otherwise null. The
  // answer then has a single fragment in the format kRaw16. `bytes` contains the headers, and this is the payload.
  std::shared_ptr<gl::GpuSum> payload;
  GpuStatus drawing;
  // The work of rendering this answer, as a number of pixels, to predict the duration of later answers. It is the area
  // of the answer's bounding rectangle if the view uses mesh blending. Other kinds of blending are slower, so they
  // count as the number of pixels that mesh blending renders in the same time.
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
