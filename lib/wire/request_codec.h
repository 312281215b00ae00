// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "view/request_limits.h"
#include "view/view_request.h"

namespace lf::wire {

// application/x-lightfield-request, see spec.md. Stateless; every length and number is checked before it is used.

// Throws Error naming the field if decode_request() would not take it back. Focal maps are deflated unless the quality
// is 0: who wants pixels uncompressed is one to whom bytes cost less than time, as where all is in one process.
std::vector<uint8_t> encode_request(const ViewRequest& request);
// Nothing for bytes that are not exactly one valid request; `reason` (may be null) then says why, naming the field.
std::optional<ViewRequest> decode_request(std::span<const uint8_t> bytes, std::string* reason = nullptr);

// What the first bytes of any unit of a request stream say: enough to pass it by without decoding it.
struct RequestPeek {
  uint8_t type = 0;  // type of the unit, see unit.h
  RequestHeader head;
};
// Nothing for bytes that do not begin as a request of this version does; what follows is not looked at.
std::optional<RequestPeek> peek_request(std::span<const uint8_t> bytes);
// What a request of any kind asks for, before anything is reserved or inflated for it: of `bytes` that are a sound unit
// the same as decoding tells. What is missing of others is nothing, and left to the decoder to refuse.
RequestCost peek_request_cost(std::span<const uint8_t> bytes);

}  // namespace lf::wire
