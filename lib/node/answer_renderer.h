// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

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
  // What has stayed on the card: the payload of the one fragment, in kRaw16, which `bytes` then ends before. Null:
  // there is none.
  std::shared_ptr<gl::CardSum> payload;
  Drawing drawing;                        // of the sum
  // Of the rectangle that bounds the sum; of more cameras than a mesh has, as many as a mesh takes as long for.
  size_t pixels = 0;
  uint64_t render_ns = 0, encode_ns = 0;  // nanoseconds of wall time; rounding to 8 bits counts as rendering
};

// An answer that is being made: a card may draw its sum together with those of others before it is finished.
class PendingAnswer {
 public:
  virtual ~PendingAnswer() = default;
  // What a card may draw; null: nothing.
  virtual SumRenderer* sum() { return nullptr; }
  // The answer; once. `memory` is recycled (see AnswerWriter). The result does not depend on `parallel`. Throws Error
  // as AnswerWriter.
  virtual RenderedAnswer finish(ByteBuffer memory, const ParallelFor& parallel) = 0;
};

// One that comes to what render_answer() does. `job` must outlive it. Throws Error as SumRenderer.
std::unique_ptr<PendingAnswer> begin_answer(const wire::AnswerHeader& header, const RenderJob& job,
                                            std::vector<Source> sources, const AnswerForm& form);

// Finishes answers one after the other, once `card`, where there is one, has drawn the sums of all of them, in as few
// passes as it can (see SumDrawer::draw()); what that takes is shared among them. `memory`: to be recycled for one.
std::vector<RenderedAnswer> finish_answers(std::span<PendingAnswer* const> answers, gl::SumDrawer* card,
                                           const std::function<ByteBuffer()>& memory, const ParallelFor& parallel);

// Renders the sum of what a node's cameras give for a view straight into the bytes of its answer: as much of the view
// as they have a weight in. `sources`: of all job.cameras(), images of the family header.family. One without an image
// (kNone) is lost weight.
// form.card draws it, where there is one. `memory` is recycled (see AnswerWriter). The result does not depend on
// `parallel`. Throws Error as SumRenderer and AnswerWriter.
RenderedAnswer render_answer(const wire::AnswerHeader& header, const RenderJob& job, std::span<const Source> sources,
                             const AnswerForm& form, ByteBuffer memory = {}, const ParallelFor& parallel = serial_for);

}  // namespace lf
