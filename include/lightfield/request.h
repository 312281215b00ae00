// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include <lightfield/error.h>

namespace lightfield {

// A request or a part of an answer: a string of bytes that any transport may carry, whole. The format is that of
// lib/wire/spec.md, which the GStreamer elements speak, too.
using Bytes = std::vector<uint8_t>;

// A time that no frame has: the newest frames are meant.
constexpr uint64_t kNewest = std::numeric_limits<uint64_t>::max();

// What whoever carries requests, or chooses frames, has to know of one.
struct RequestInfo {
  uint32_t view_id = 0;     // the number of the viewer whose request this is
  uint32_t sequence = 0;    // grows by one with each request of this viewer, and wraps
  uint64_t time = kNewest;  // when the frames that are asked for were captured, nanoseconds
};

// Throws Error if the bytes are not exactly one request. They may come from anywhere.
RequestInfo read_request(const Bytes& request);

}  // namespace lightfield
