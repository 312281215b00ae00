// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/text.h"
#include "rig/rig.h"

namespace lf::wire {

// Numbers on the wire are big-endian.

template <typename T>
using WireInt = std::conditional_t<
    sizeof(T) == 8, uint64_t,
    std::conditional_t<sizeof(T) == 4, uint32_t, std::conditional_t<sizeof(T) == 2, uint16_t, uint8_t>>>;

template <typename T>
void store(uint8_t* to, T value) {
  static_assert(std::is_unsigned_v<T> || std::is_same_v<T, double>);
  const auto bits = std::bit_cast<WireInt<T>>(value);
  for (size_t i = 0; i < sizeof(T); i++) to[i] = static_cast<uint8_t>(bits >> (8 * (sizeof(T) - 1 - i)));
}

// Appends numbers to a message.
class Writer {
 public:
  explicit Writer(size_t size) { bytes_.reserve(size); }

  // Writes an unsigned integer of 1, 2, 4 or 8 bytes, or a double (IEEE 754 binary64).
  template <typename T>
  void put(T value) {
    uint8_t out[sizeof(T)];
    store(out, value);
    bytes_.insert(bytes_.end(), out, out + sizeof(T));
  }
  void put_bytes(std::span<const uint8_t> bytes) { bytes_.insert(bytes_.end(), bytes.begin(), bytes.end()); }

  size_t size() const { return bytes_.size(); }
  std::vector<uint8_t> take() { return std::move(bytes_); }

 private:
  std::vector<uint8_t> bytes_;
};

// Like Writer, but writes into existing memory, which must be large enough.
class BufferWriter {
 public:
  explicit BufferWriter(uint8_t* to) : to_(to) {}
  template <typename T>
  void put(T value) {
    store(to_, value);
    to_ += sizeof(T);
  }
  void put_bytes(std::span<const uint8_t> bytes) { to_ = std::copy(bytes.begin(), bytes.end(), to_); }

 private:
  uint8_t* to_;
};

// Reads values from the front of a message. A read past the end returns 0, and ok() then stays false. A parser can
// therefore read all fields without checks, and then must check ok() before it uses the values.
class Reader {
 public:
  explicit Reader(std::span<const uint8_t> bytes) : bytes_(bytes) {}

  template <typename T>
  T get() {
    static_assert(std::is_unsigned_v<T> || std::is_same_v<T, double>);
    WireInt<T> bits = 0;
    for (const uint8_t byte : get_bytes(sizeof(T))) bits = static_cast<WireInt<T>>((uint64_t{bits} << 8) | byte);
    return std::bit_cast<T>(bits);
  }
  // Returns a view of the next `count` bytes, or an empty view if there are fewer.
  std::span<const uint8_t> get_bytes(size_t count) {
    if (count > bytes_.size()) {
      ok_ = false;
      bytes_ = {};
      return {};
    }
    const std::span<const uint8_t> out = bytes_.first(count);
    bytes_ = bytes_.subspan(count);
    return out;
  }

  size_t left() const { return bytes_.size(); }
  bool ok() const { return ok_; }

 private:
  std::span<const uint8_t> bytes_;
  bool ok_ = true;
};

// The two functions convert one field of a message. The field has the type T on the wire. A function template with such
// calls for all fields, in their order, can both write and read a message.
template <typename T, typename Value>
void field(Reader& in, Value& value) {
  value = static_cast<Value>(in.get<T>());
}
template <typename T, typename Out, typename Value>
void field(Out& out, const Value& value) {
  out.put(static_cast<T>(value));
}

// Limits of the wire format. Decoders reject larger units; see spec.md.
inline constexpr uint8_t kVersion = 1;
inline constexpr size_t kMaxRequestBytes = size_t{1} << 20;  // enough for warp commands to 3500 cameras
inline constexpr size_t kMaxAnswerBytes = size_t{1} << 30;   // enough for 8192 x 8192 RGB fragments of a whole array
// Default limit of elements that store whole answers. It is enough for a 16-bit sum of 4096 x 2304 pixels with missing
// weight.
inline constexpr size_t kTypicalAnswerBytes = size_t{80} << 20;
inline constexpr size_t kMaxDeflateRatio = 1032;             // inflated bytes per deflated byte
inline constexpr size_t kMaxSources = 4096;                  // camera sets in the answers to one request
inline constexpr size_t kMaxTriangleRows = size_t{1} << 21;  // sum of the rectangle heights in a warp command
inline constexpr uint32_t kMaxFragments = kMaxCameras + 1;
inline constexpr int kMaxViewSize = kMaxImageSize;  // pixels per side

// All units start with a magic number, version, type, flags and total length. This header is the same in every version
// of the format, so readers can find the end of units of later versions and can forward these units.
enum class UnitKind { kRequest, kAnswer };
inline constexpr size_t kUnitHeaderBytes = 12;

// Both magic numbers begin with these bytes, so readers can find the next unit in a damaged stream. The fourth byte is
// 'Q' or 'A'.
inline constexpr uint8_t kMagicPrefix[3] = {0x8f, 'L', 'F'};
inline constexpr uint8_t kRequestMagic = 'Q', kAnswerMagic = 'A';

// Types of units in request streams and in answer streams; see spec.md. Readers that only look for the ends of units
// forward unknown types.
inline constexpr uint8_t kViewRequestType = 1, kWarpCommandType = 3, kPixelCommandType = 4;
inline constexpr uint8_t kFragmentsType = 1, kConsistencyType = 5;

struct UnitHeader {
  UnitKind kind;
  size_t size;  // whole unit with the header, bytes; within the limits above
  uint8_t version = 0, type = 0;
  uint16_t flags = 0;
};
// Parses a unit header from the first kUnitHeaderBytes bytes. Returns nullopt if no unit starts there.
std::optional<UnitHeader> peek_unit(std::span<const uint8_t> bytes);

// Returns the number of bytes that a reader must skip after a damaged unit, which is the distance to the next magic
// number, but at least 1. `more_to_come` means that more bytes follow: an incomplete magic number at the end is then
// not skipped. `bytes` must not be empty.
size_t distance_to_magic(std::span<const uint8_t> bytes, bool more_to_come);

template <typename Out>
void put_unit_header(Out& out, UnitKind kind, uint8_t type, uint16_t flags, size_t size) {
  out.put_bytes(kMagicPrefix);
  out.put(kind == UnitKind::kRequest ? kRequestMagic : kAnswerMagic);
  out.put(kVersion);
  out.put(type);
  out.put(flags);
  out.put(static_cast<uint32_t>(size));
}

// Returns the header of a unit that has this kind and type, the current version, and no flags beyond `known_flags`.
// Otherwise throws Error. `bytes` may end before the unit.
UnitHeader read_unit_header(std::span<const uint8_t> bytes, UnitKind kind, uint8_t type, uint16_t known_flags);
// Throws Error unless `bytes` has the size in the header.
void check_unit_size(std::span<const uint8_t> bytes, const UnitHeader& header);

// Returns read(). If read() throws Error, returns nullopt and copies the error's text to *reason, unless null.
template <typename F>
auto catch_reason(std::string* reason, F read) -> std::optional<decltype(read())> {
  try {
    return read();
  } catch (const Error& error) {
    if (reason) *reason = error.what();
    return std::nullopt;
  }
}

// Compresses in zlib format (RFC 1950) at the fastest setting, because the data is small and encoded for every frame.
std::vector<uint8_t> deflate_all(std::span<const uint8_t> bytes);
// Returns the bytes in zlib format without compression, which is fast, for messages within one process.
std::vector<uint8_t> store_all(std::span<const uint8_t> bytes);
// Decompresses zlib data. Throws Error unless the result has exactly `size` bytes. Never reserves more memory than the
// input can inflate to, so a forged `size` does no harm.
std::vector<uint8_t> inflate_exactly(std::span<const uint8_t> deflated, size_t size);

}  // namespace lf::wire
