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

class CameraGains;
class RequestPlan;
struct RenderOptions;

enum class CodecChoice {
  kAuto,   // 16 bits a value within a process; over links JPEG of the quality asked for
  kRaw,    // 8 bits a value
  kRaw16,  // 16 bits a value
  kJpeg,   // JPEG of the quality asked for; raw where that is 0
};

// How pixels are coded.
struct Coding {
  wire::Codec codec = wire::Codec::kRaw;  // kRaw, kRaw16 or kJpeg
  int quality = 0;                        // quality of JPEG, 1 to 100; else 0
  bool operator==(const Coding&) const = default;
};

// `in_process`: the compositor takes the bytes as they are, so that bytes cost nothing and coding them does. `quality`:
// of the request, 0 to 100.
Coding choose_coding(CodecChoice codec, bool in_process, int quality);

// How many empty pixels of a view cost as much as one more fragment: see sum_tiles().
size_t spare_pixels(const View& view, wire::Codec codec, bool in_process);

// The moments of all trials of a request.
struct RenderedTrials {
  ByteBuffer unit;  // unit of moments; empty: there are no trials
  Drawing drawing;
  size_t nodes = 0;  // nodes of all trials
  uint64_t ns = 0;   // nanoseconds of wall time
};

// The answer to a request: up to three units of the answer stream, in sending order, and the time that each step took.
struct RenderedAnswer {
  ByteBuffer brightness;  // unit of moments; empty: the request does not ask how bright cameras are
  RenderedTrials trials;
  ByteBuffer bytes;  // the answer itself
  size_t fragments = 0;
  // A sum that has stayed on the card: the payload of the one fragment, in kRaw16, which `bytes` then ends before.
  // Null: there is none.
  std::shared_ptr<gl::CardSum> payload;
  Drawing drawing;  // of the sum
  // Pixels of the rectangle that bounds the sum; of more cameras than a mesh has, as many as a mesh takes as long for.
  size_t pixels = 0;
  // Gains that the images were divided by, valid until the renderer's next call; null: they were not divided.
  const CameraGains* gains = nullptr;
  // Nanoseconds of wall time: for correcting the images, brightness and trials; for the sum, which includes rounding it
  // to 8 bits; and for coding.
  uint64_t prepare_ns = 0, render_ns = 0, encode_ns = 0;
};

// Both write the bytes, fragments, payload and encode_ns of an answer. `sources`: the images that are drawn, of the
// family header.family. `memory` is recycled (see AnswerWriter). The result does not depend on options.parallel. Throw
// Error as AnswerWriter.

// As much of the view as the sources have a weight in. `sum`: of plan.sum(), drawn from the sources.
void encode_sum(const wire::AnswerHeader& header, const RequestPlan& plan, std::span<const Source> sources,
                const SumRenderer& sum, const RenderOptions& options, ByteBuffer memory, RenderedAnswer& answer);

// The pixels that the plan asks for as they are; sources without an image are left out. Throws Error for images that
// are not of their camera's size or of the family of the header.
void encode_pixels(const wire::AnswerHeader& header, const RequestPlan& plan, std::span<const Source> sources,
                   const RenderOptions& options, ByteBuffer memory, RenderedAnswer& answer);

}  // namespace lf
