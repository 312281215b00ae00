// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "view/view_request.h"
#include "wire/unit.h"

namespace lf::wire {

// What the units of a request stream have in common; see spec.md.
inline constexpr uint16_t kAbsoluteTime = 1, kProbe = 2, kRehearsal = 4, kOfSet = 8;  // in the flags of the unit
inline constexpr size_t kRequestHeadBytes = kUnitHeaderBytes + 29;                    // all fields up to the quality

// Throws Error naming the field. The size of the view is checked with the rest of it.
void check_request_head(const RequestHeader& head);

// Writes the unit's header, with flags that only its type has in `more_flags`, and the fields that all types of
// requests begin with.
void put_request_head(Writer& out, uint8_t type, const RequestHeader& head, int width, int height, size_t size,
                      uint16_t more_flags = 0);
// Reads the fields behind the unit's header, whose flags are given. Returns width and height of the view.
std::pair<int, int> get_request_head(Reader& in, uint16_t flags, RequestHeader& head);
// Reads the unit's header and these fields; the Reader that it returns has what follows. *more_flags: those of the
// flags that it is given, which only this type has, that are set; null: it has none. Throws Error if the bytes are not
// exactly one unit of that type, or end before the fields do.
Reader read_request_head(std::span<const uint8_t> bytes, uint8_t type, RequestHeader& head, int& width, int& height,
                         uint16_t* more_flags = nullptr);

// Throws Error if the request ended before `field` did.
void need_more(const Reader& in, const char* field);

void put_vec(Writer& out, const Vec3& v);
Vec3 get_vec(Reader& in);
// The parameters of a lens alone; its model stands elsewhere, as a code. read_lens() throws Error naming the field.
void put_lens(Writer& out, const Lens& lens);
Lens read_lens(Reader& in, uint8_t model_code);

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
