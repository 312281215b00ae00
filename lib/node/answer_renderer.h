// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <span>

#include "base/byte_buffer.h"
#include "base/worker_pool.h"
#include "node/answer_form.h"
#include "render/ownership.h"
#include "render/sum_renderer.h"
#include "wire/answer.h"

namespace lf {

// What render_answer() came to.
struct RenderedAnswer {
  ByteBuffer bytes;  // one unit of the answer stream
  size_t fragments = 0;
  // What has stayed on the card: the payload of the one fragment, of the whole view in kRaw16, which `bytes` then ends
  // before. Null: there is none.
  std::shared_ptr<gl::CardSum> payload;
  Drawing drawing;                        // of the sum
  size_t pixels = 0;                      // of the rectangle that bounds the sum
  uint64_t render_ns = 0, encode_ns = 0;  // nanoseconds of wall time; rounding to 8 bits counts as rendering
};

// Renders the sum of what a node's cameras give for a view straight into the bytes of its answer: as much of the view
// as they have a weight in. `sources`: of all job.cameras(), images of the family header.family. One without an image
// (kNone) is lost weight.
// `memory` is recycled (see AnswerWriter). The result does not depend on `parallel`. Throws Error as SumRenderer and
// AnswerWriter.
RenderedAnswer render_answer(const wire::AnswerHeader& header, const RenderJob& job, std::span<const Source> sources,
                             const AnswerForm& form, ByteBuffer memory = {}, const ParallelFor& parallel = serial_for);

}  // namespace lf
