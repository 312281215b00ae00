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

inline constexpr uint16_t kAbsoluteTime = 1, kProbe = 2, kWarmup = 4, kInSet = 8;  // unit flags
inline constexpr size_t kRequestHeadBytes = kUnitHeaderBytes + 29;                 // all fields up to the quality

// Throws Error with the invalid field. The size of the view is checked elsewhere.
void check_request_head(const RequestHeader& head);

// Writes the unit header and the fields that all request types share. `more_flags`: type-specific flags.
void put_request_head(Writer& out, uint8_t type, const RequestHeader& head, int width, int height, size_t size,
                      uint16_t more_flags = 0);
// Reads the shared fields after the unit header. `flags`: the unit's flags. Returns width and height of the view.
std::pair<int, int> get_request_head(Reader& in, uint16_t flags, RequestHeader& head);
// Reads the unit header and the shared fields; the returned Reader is at the next field. *more_flags (may be null): in:
// type-specific flags to accept; out: the flags that are set. Throws Error unless `bytes` is exactly one unit of that
// type and holds all fields.
Reader read_request_head(std::span<const uint8_t> bytes, uint8_t type, RequestHeader& head, int& width, int& height,
                         uint16_t* more_flags = nullptr);

// Throws Error if the request ended before `field`.
void check_remaining(const Reader& in, const char* field);

void put_vec(Writer& out, const Vec3& v);
Vec3 get_vec(Reader& in);
// Lens parameters without the model, which has a separate code. read_lens() throws Error with the invalid field.
void put_lens(Writer& out, const Lens& lens);
Lens read_lens(Reader& in, uint8_t model_code);

// application/x-lightfield-request, see spec.md. Stateless; all lengths and values are checked before use.

// Throws Error with the invalid field if decode_request() would reject the result. Focal maps are deflated unless the
// quality is 0: in that case time costs more than bytes, for example within one process.
std::vector<uint8_t> encode_request(const ViewRequest& request);
// Returns nullopt unless `bytes` is exactly one valid request; `reason` (may be null) then receives the invalid field.
std::optional<ViewRequest> decode_request(std::span<const uint8_t> bytes, std::string* reason = nullptr);

// The first fields of a request unit, for routing a request without decoding it.
struct RequestPeek {
  uint8_t type = 0;
  RequestHeader head;
};
// Returns nullopt unless `bytes` starts a request of this version. Does not check the rest.
std::optional<RequestPeek> peek_request(std::span<const uint8_t> bytes);
// Returns the cost of a request of any kind before memory is reserved or data is inflated. The cost of a valid unit
// equals its cost after decoding. Missing fields count as 0; the decoder rejects such units.
RequestCost peek_request_cost(std::span<const uint8_t> bytes);

}  // namespace lf::wire
