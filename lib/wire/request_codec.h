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
inline constexpr size_t kRequestHeadBytes = kUnitHeaderBytes + 29;                 // ends with the quality

// Checks the fields that all request types share. Throws Error with the invalid field. Does not check the size of the
// view.
void check_request_head(const RequestHeader& head);

// Writes the unit header and the fields that all request types share. `more_flags` are further flags of this type.
void put_request_head(Writer& out, uint8_t type, const RequestHeader& head, int width, int height, size_t size,
                      uint16_t more_flags = 0);
// Reads the shared fields that follow the unit header with these flags. Returns the width and height of the view.
std::pair<int, int> get_request_head(Reader& in, uint16_t flags, RequestHeader& head);
// Reads the unit header and the shared fields, and returns a Reader at the next field. Unless null, *more_flags
// contains the allowed further flags, and receives the flags that are set. Throws Error unless `bytes` is exactly one
// unit of this type with all shared fields.
Reader read_request_head(std::span<const uint8_t> bytes, uint8_t type, RequestHeader& head, int& width, int& height,
                         uint16_t* more_flags = nullptr);

// Checks that a parser has not read past the end of the request. Throws Error if the request ended before `field`.
void check_remaining(const Reader& in, const char* field);

void put_vec(Writer& out, const Vec3& v);
Vec3 get_vec(Reader& in);
// These functions convert the lens parameters. The lens model has its own code elsewhere in the message. read_lens()
// throws Error with the invalid field.
void put_lens(Writer& out, const Lens& lens);
Lens read_lens(Reader& in, uint8_t model_code);

// The functions below convert view requests to and from units of type application/x-lightfield-request; see spec.md.
// They check all lengths and values before use.

// Encodes a view request. Focal maps are compressed unless the quality is 0, which is useful if time costs more than
// bytes, for example within one process. Throws Error with the invalid field if decode_request() would reject the
// result.
std::vector<uint8_t> encode_request(const ViewRequest& request);
// Returns nullopt unless `bytes` is exactly one valid request. `reason`, unless null, then receives a text that names
// the invalid field.
std::optional<ViewRequest> decode_request(std::span<const uint8_t> bytes, std::string* reason = nullptr);

// The first fields of a request unit, which are enough for routing without decoding.
struct RequestPeek {
  uint8_t type = 0;
  RequestHeader head;
};
// Returns nullopt unless `bytes` starts a request of this version. Does not check the rest.
std::optional<RequestPeek> peek_request(std::span<const uint8_t> bytes);
// Returns the cost of an encoded request of any kind, so that expensive requests can be refused before they are
// decoded. For a valid unit, the result is the same as the cost of the decoded request. Missing fields count as 0,
// because the decoder rejects incomplete units.
RequestCost peek_request_cost(std::span<const uint8_t> bytes);

}  // namespace lf::wire
