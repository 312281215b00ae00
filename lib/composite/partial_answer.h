// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "base/byte_buffer.h"
#include "base/parallel.h"
#include "composite/accumulator.h"
#include "node/answer_form.h"
#include "wire/answer.h"

namespace lf {

// What a compositor inside a tree sends on: the sum of what was added, as the answer of one node. With 16 bits a value
// the picture at the root is that of one compositor to the bit (unless a value saturated); with 8 it is rounded once
// more for each level of the tree, within half a level; JPEG adds its error. `header.family` is the accumulator's.
// `memory` is recycled. Throws Error if the header is not fit for the wire.
ByteBuffer partial_answer(const wire::AnswerHeader& header, const Accumulator& sum, const CodedAs& form,
                          ByteBuffer memory, const ParallelFor& parallel = serial_for);

}  // namespace lf
