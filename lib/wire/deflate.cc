// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/deflate.h"

#include <algorithm>
#include <string>

#include <zlib.h>

#include "base/error.h"
#include "wire/limits.h"

namespace lf::wire {

std::vector<uint8_t> deflate_all(std::span<const uint8_t> bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::vector<uint8_t> deflated(size);
  if (compress2(deflated.data(), &size, bytes.data(), static_cast<uLong>(bytes.size()), Z_BEST_SPEED) != Z_OK)
    throw Error("zlib: can't deflate " + std::to_string(bytes.size()) + " bytes");
  deflated.resize(size);
  return deflated;
}

// By hand, because zlib clears a quarter of a megabyte for each stream, compressed or not.
std::vector<uint8_t> store_all(std::span<const uint8_t> bytes) {
  constexpr size_t kLargestBlock = 65535;
  const auto low = [](size_t value) { return static_cast<uint8_t>(value & 0xff); };
  std::vector<uint8_t> out = {0x78, 0x01};
  out.reserve(2 + bytes.size() + 5 * (bytes.size() / kLargestBlock + 1) + 4);
  const uLong sum = adler32(adler32(0, nullptr, 0), bytes.data(), static_cast<uInt>(bytes.size()));
  do {
    const std::span<const uint8_t> block = bytes.first(std::min(bytes.size(), kLargestBlock));
    bytes = bytes.subspan(block.size());
    const size_t size = block.size(), inverse = ~size;
    out.push_back(bytes.empty() ? 1 : 0);  // the last one
    for (const size_t value : {size, inverse}) {
      out.push_back(low(value));
      out.push_back(low(value >> 8));
    }
    out.insert(out.end(), block.begin(), block.end());
  } while (!bytes.empty());
  for (const int shift : {24, 16, 8, 0}) out.push_back(low(sum >> shift));
  return out;
}

std::vector<uint8_t> inflate_exactly(std::span<const uint8_t> deflated, size_t size) {
  if (size > kMaxInflation * deflated.size())
    throw Error("deflated bytes: " + std::to_string(deflated.size()) + " can't be those of " + std::to_string(size));
  std::vector<uint8_t> bytes(size);
  uLongf written = static_cast<uLongf>(size);
  uLong read = static_cast<uLong>(deflated.size());
  if (uncompress2(bytes.data(), &written, deflated.data(), &read) != Z_OK || written != size || read != deflated.size())
    throw Error("deflated bytes: are not those of " + std::to_string(size));
  return bytes;
}

}  // namespace lf::wire
