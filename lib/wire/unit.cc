// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/unit.h"

#include <algorithm>
#include <string>

#include <zlib.h>

#include "base/text.h"

namespace lf::wire {
namespace {

size_t max_size(UnitKind kind) { return kind == UnitKind::kRequest ? kMaxRequestBytes : kMaxAnswerBytes; }
const char* name(UnitKind kind) { return kind == UnitKind::kRequest ? "request" : "answer"; }

std::optional<UnitKind> kind_of(std::span<const uint8_t> bytes) {
  if (!std::equal(std::begin(kMagicPrefix), std::end(kMagicPrefix), bytes.begin())) return std::nullopt;
  if (bytes[3] == kRequestMagic) return UnitKind::kRequest;
  if (bytes[3] == kAnswerMagic) return UnitKind::kAnswer;
  return std::nullopt;
}

UnitHeader read_header(std::span<const uint8_t> bytes, UnitKind kind) {
  Reader in(bytes.subspan(4, kUnitHeaderBytes - 4));
  UnitHeader header{.kind = kind, .size = 0};
  header.version = in.get<uint8_t>();
  header.type = in.get<uint8_t>();
  header.flags = in.get<uint16_t>();
  header.size = in.get<uint32_t>();
  return header;
}

bool size_in_limits(const UnitHeader& header) {
  return header.size >= kUnitHeaderBytes && header.size <= max_size(header.kind);
}

}  // namespace

std::optional<UnitHeader> peek_unit(std::span<const uint8_t> bytes) {
  if (bytes.size() < kUnitHeaderBytes) return std::nullopt;
  const std::optional<UnitKind> kind = kind_of(bytes);
  if (!kind) return std::nullopt;
  const UnitHeader header = read_header(bytes, *kind);
  if (header.version == 0 || header.type == 0 || !size_in_limits(header)) return std::nullopt;
  return header;
}

size_t distance_to_magic(std::span<const uint8_t> bytes, bool more_to_come) {
  const auto from = bytes.begin() + 1;
  auto found = std::search(from, bytes.end(), std::begin(kMagicPrefix), std::end(kMagicPrefix));
  if (found == bytes.end() && more_to_come) {
    const auto tail = bytes.end() - std::min<ptrdiff_t>(std::size(kMagicPrefix) - 1, bytes.end() - from);
    found = std::find_if(tail, bytes.end(), [&](const uint8_t& byte) {
      return std::equal(&byte, bytes.data() + bytes.size(), std::begin(kMagicPrefix));
    });
  }
  return static_cast<size_t>(found - bytes.begin());
}

UnitHeader read_unit_header(std::span<const uint8_t> bytes, UnitKind kind, uint8_t type, uint16_t known_flags) {
  if (bytes.size() < kUnitHeaderBytes)
    throw Error("header: needs " + std::to_string(kUnitHeaderBytes) + " bytes, there are " +
                std::to_string(bytes.size()));
  if (kind_of(bytes) != kind) throw Error(std::string("magic: no ") + name(kind) + " begins here");
  const UnitHeader header = read_header(bytes, kind);
  if (header.version != kVersion)
    throw Error("version: " + std::to_string(header.version) + " is not supported, only " + std::to_string(kVersion));
  if (header.type != type)
    throw Error("type: " + std::to_string(header.type) + " is not supported in " + name(kind) + " units");
  if (header.flags & ~known_flags) throw Error("flags: unknown bits " + std::to_string(header.flags & ~known_flags));
  if (!size_in_limits(header))
    throw Error("length: " + std::to_string(header.size) + " bytes, must be " + std::to_string(kUnitHeaderBytes) +
                " to " + std::to_string(max_size(kind)));
  return header;
}

void check_unit_size(std::span<const uint8_t> bytes, const UnitHeader& header) {
  if (bytes.size() != header.size)
    throw Error("length: the unit says " + std::to_string(header.size) + " bytes, there are " +
                std::to_string(bytes.size()));
}

std::vector<uint8_t> deflate_all(std::span<const uint8_t> bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::vector<uint8_t> deflated(size);
  if (compress2(deflated.data(), &size, bytes.data(), static_cast<uLong>(bytes.size()), Z_BEST_SPEED) != Z_OK)
    throw Error("zlib: can't deflate " + std::to_string(bytes.size()) + " bytes");
  deflated.resize(size);
  return deflated;
}

// Does not use zlib, which clears a quarter of a megabyte for each stream, even without compression.
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
    out.push_back(bytes.empty() ? 1 : 0);
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
  if (size > kMaxDeflateRatio * deflated.size())
    throw Error("deflated bytes: " + std::to_string(deflated.size()) + " cannot inflate to " + std::to_string(size));
  std::vector<uint8_t> bytes(size);
  uLongf written = static_cast<uLongf>(size);
  uLong read = static_cast<uLong>(deflated.size());
  if (uncompress2(bytes.data(), &written, deflated.data(), &read) != Z_OK || written != size || read != deflated.size())
    throw Error("deflated bytes: do not inflate to " + std::to_string(size));
  return bytes;
}

}  // namespace lf::wire
