// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace lf::wire {

// RFC 1950 (zlib), at the fastest setting: what is coded so is small and made for every picture.
std::vector<uint8_t> deflate_all(std::span<const uint8_t> bytes);
// The zlib format for those to whom bytes cost nothing: the bytes as they are, in blocks that are not compressed.
std::vector<uint8_t> store_all(std::span<const uint8_t> bytes);
// Throws Error if the bytes are not those of exactly `size` bytes. Reserves no more memory than so few
// bytes can hold.
std::vector<uint8_t> inflate_exactly(std::span<const uint8_t> deflated, size_t size);

}  // namespace lf::wire
