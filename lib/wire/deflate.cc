// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/deflate.h"

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
