// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "render/fragment.h"
#include "view/view_request.h"
#include "wire/unit.h"

namespace lf::wire {

// What one node has to give for one request of one view: one buffer.
struct Answer {
  uint32_t view_id = 0;
  uint32_t sequence = 0;
  int view_width = 0, view_height = 0;      // pixels
  PixelFamily family = PixelFamily::kNone;  // of all its fragments; kNone: the node has no camera image yet
  uint64_t target_time = kNoTime;           // as in the request, nanoseconds
  uint64_t actual_time = kNoTime;           // capture time of the frame farthest from the target; same clock
  uint64_t rig_hash = 0;
  uint32_t node = 0;
  bool last_of_node = true;  // nothing more comes from this node for this request
  std::vector<Fragment> fragments;
  bool operator==(const Answer&) const = default;
};

// application/x-lightfield-answer, see spec.md. Stateless; every length and number is checked before it is used.

// Throws Error naming the field if decode_answer() would not take it back (sizes, rectangles, planes, limits).
std::vector<uint8_t> encode_answer(const Answer& answer);
// Nothing for bytes that are not exactly one valid answer; `reason` (may be null) then says why, naming the field.
// Fragments come out with rectangles inside the view and planes of exactly their sizes.
std::optional<Answer> decode_answer(std::span<const uint8_t> bytes, std::string* reason = nullptr);

// The fields in front of the fragment table alone, without fragments; cheap. Same checks for these fields. `bytes` may
// end anywhere after them.
std::optional<Answer> decode_answer_header(std::span<const uint8_t> bytes, std::string* reason = nullptr);

}  // namespace lf::wire
