// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "wire/answer.h"

namespace lf::wire {

// Reading an answer where it lies: nothing is copied, payloads refer to `bytes`. Everything is checked that can be
// without decoding JPEG: rectangles inside the view, payloads of exactly their sizes (raw), within them and no shorter
// than any scan of their size (JPEG). Stateless; memory for the table alone.

// Nothing for bytes that are not exactly one valid answer; `reason` (may be null) then says why, naming the field.
std::optional<AnswerView> parse_answer(std::span<const uint8_t> bytes, std::string* reason = nullptr);

// Reads the fields in front of the fragment table alone, with the same checks; cheap. `bytes` may end anywhere after
// them.
std::optional<AnswerPartHeader> parse_answer_header(std::span<const uint8_t> bytes, std::string* reason = nullptr);

// The id of the view that a unit of an answer stream, of any type, is about: enough to pass it by. Nothing for bytes
// that do not begin as such a unit of this version does; what follows is not looked at.
std::optional<uint32_t> peek_answer_view(std::span<const uint8_t> bytes);

// Width and height, pixels, of the view that a unit of fragments is about; nothing for other units, and for bytes that
// do not begin as such a unit of this version does.
std::optional<std::pair<int, int>> peek_answer_size(std::span<const uint8_t> bytes);

}  // namespace lf::wire
