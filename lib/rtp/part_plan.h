// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "base/byte_buffer.h"
#include "wire/answer_parser.h"
#include "wire/tiles.h"

namespace lf::rtp {

// How an answer is divided into parts, each a unit of its own of at most so many bytes. Pure.

// What stays together: a fragment of the answer, or a tile of a raw one.
struct Piece {
  size_t fragment = 0;
  std::optional<Rect> tile;
  size_t bytes = 0;  // bytes of payload
};

struct Part {
  size_t first = 0, count = 0;  // pieces, each a fragment of its own
  size_t bytes = 0;             // bytes of the unit
};

struct PartPlan {
  std::vector<Piece> pieces;
  std::vector<Part> parts;  // a part of a single piece may have more than `max_bytes`
  uint32_t total = 0;       // fragments of the whole answer, tiles counted
};

// Plans the parts: in the table's order, as many pieces in a part as have room. Raw fragments that have none are cut
// into tiles where all the answer is at hand: the number of its fragments is told in each part. Nothing if dividing is
// of no use, because the header alone takes up most of a part.
std::optional<PartPlan> plan_parts(const wire::AnswerView& answer, size_t max_bytes);

// The unit of one part, made in `memory`.
ByteBuffer write_part(const wire::AnswerView& answer, const PartPlan& plan, const Part& part, ByteBuffer memory);

}  // namespace lf::rtp
