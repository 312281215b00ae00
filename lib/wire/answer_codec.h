// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "wire/answer.h"

namespace lf::wire {

// Answers as vectors of uncompressed fragments, for those whom a copy does not hurt: tests and tools. Where time counts
// see AnswerWriter, FragmentEncoder, parse_answer() and FragmentDecoder. Stateless.

// Raw. Throws Error naming the field if decode_answer() would not take it back (sizes, rectangles, planes, limits).
std::vector<uint8_t> encode_answer(const Answer& answer);
// Nothing for bytes that are not exactly one valid answer, whole, with sound payloads; `reason` (may be null) then says
// why, naming the field. Fragments come out with rectangles inside the view and planes of exactly their sizes, whatever
// their codec: 16-bit sums are rounded (halves up) and saturated to 8 bits.
std::optional<Answer> decode_answer(std::span<const uint8_t> bytes, std::string* reason = nullptr);

}  // namespace lf::wire
