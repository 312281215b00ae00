// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "base/error.h"
#include "wire/answer.h"

// What reading and writing answers have in common: numbers of spec.md, and what both ask of fields.
namespace lf::wire {

inline constexpr uint16_t kLastOfNode = 1;  // in the flags of the unit
inline constexpr size_t kAnswerHeaderBytes = 72, kRangeBytes = 4, kFragmentBytes = 20;
inline constexpr uint16_t kWeighted = 1, kLostPlane = 2;  // in the flags of a fragment
inline constexpr uint16_t kSumOnWire = 0xffff;            // in the field `camera`: a sum

// These throw Error naming the field that is not fit for the wire.
void check_header(const AnswerHeader& answer, size_t fragments);
void check_part(const AnswerPart& part);
void check_fragment(const AnswerHeader& answer, const FragmentHeader& fragment);

// How many bytes into the answer the fragment table begins.
inline size_t table_offset(const AnswerHeader& answer) {
  return kAnswerHeaderBytes + kRangeBytes * (answer.cameras.ranges().size() + answer.blind.ranges().size());
}

// Runs f(), with "fragments[3]." in front of the text of an Error.
template <typename F>
auto in_fragment(size_t index, F f) {
  try {
    return f();
  } catch (const Error& error) {
    throw Error("fragments[" + std::to_string(index) + "]." + error.what());
  }
}

}  // namespace lf::wire
