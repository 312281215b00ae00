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

// Big-endian numbers in byte strings.

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

// Appends numbers and bytes to a vector, whose memory is reserved for the size given.
class Writer {
 public:
  explicit Writer(size_t size) { bytes_.reserve(size); }

  // Unsigned integers of 1, 2, 4, 8 bytes, and double (IEEE 754 binary64).
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

// Writes as Writer does, into memory that is there and large enough.
class PlacedWriter {
 public:
  explicit PlacedWriter(uint8_t* to) : to_(to) {}
  template <typename T>
  void put(T value) {
    store(to_, value);
    to_ += sizeof(T);
  }
  void put_bytes(std::span<const uint8_t> bytes) { to_ = std::copy(bytes.begin(), bytes.end(), to_); }

 private:
  uint8_t* to_;
};

// Reads numbers and bytes from the front. Whatever lies beyond the end reads as 0 and makes ok() false for good: check
// it before using what was read.
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
  // Refers to the bytes read from; empty if there are not as many.
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

// The limits of the wire format, in one place. A unit beyond them is not decoded; see spec.md.
inline constexpr uint8_t kVersion = 1;
inline constexpr size_t kMaxRequestBytes = size_t{1} << 20;  // 1 MiB: warp commands for 3500 cameras in one view
inline constexpr size_t kMaxAnswerBytes = size_t{1} << 30;   // 1 GiB: 8192 x 8192 RGB fragments of a whole array
// What elements that keep answers until they are whole take by default: a sum of 4096 x 2304 pixels in 16 bits with its
// lost weight, and its table.
inline constexpr size_t kUsualAnswerBytes = size_t{80} << 20;
inline constexpr size_t kMaxInflation = 1032;  // bytes that a byte of deflated ones can come to
inline constexpr size_t kMaxSources = 4096;    // sets of cameras that the answers to one request speak for
inline constexpr size_t kMaxTriangleRows = size_t{1} << 21;  // rows of all rectangles in a warp command together
inline constexpr uint32_t kMaxFragments = kMaxCameras + 1;
inline constexpr int kMaxViewSize = kMaxImageSize;  // pixels a side

// What both streams have in common: a unit begins with magic, version, type, flags and its whole length. This frame is
// the same in every version of the format, so that units of a later one can be told apart and passed on.
enum class UnitKind { kRequest, kAnswer };
inline constexpr size_t kUnitHeaderBytes = 12;

// The first three bytes of both kinds' magic, for those who search a stream for one; the fourth is 'Q' or 'A'.
inline constexpr uint8_t kMagicPrefix[3] = {0x8f, 'L', 'F'};
inline constexpr uint8_t kRequestMagic = 'Q', kAnswerMagic = 'A';

// Types of units, see spec.md: in a request stream, and in an answer stream. Others are passed on by whoever only
// frames.
inline constexpr uint8_t kViewRequestType = 1, kWarpCommandType = 3, kPixelCommandType = 4;
inline constexpr uint8_t kFragmentsType = 1, kMomentsType = 5;

struct UnitHeader {
  UnitKind kind;
  size_t size;  // bytes of the whole unit, header included; within the limits above
  uint8_t version = 0, type = 0;
  uint16_t flags = 0;
};
// The header of a unit, from its first kUnitHeaderBytes bytes; nothing if they are not the beginning of one.
std::optional<UnitHeader> peek_unit(std::span<const uint8_t> bytes);

// How many bytes of a stream to pass over, at least 1, where no unit begins: up to where a magic begins, or may begin
// if more bytes come. `bytes` is not empty.
size_t distance_to_magic(std::span<const uint8_t> bytes, bool more_to_come);

// `out`: a Writer or PlacedWriter.
template <typename Out>
void put_unit_header(Out& out, UnitKind kind, uint8_t type, uint16_t flags, size_t size) {
  out.put_bytes(kMagicPrefix);
  out.put(kind == UnitKind::kRequest ? kRequestMagic : kAnswerMagic);
  out.put(kVersion);
  out.put(type);
  out.put(flags);
  out.put(static_cast<uint32_t>(size));
}

// The header of a unit of this kind, type and version without flags beyond `known_flags`, or nothing and the reason.
std::optional<UnitHeader> check_unit_header(std::span<const uint8_t> bytes, UnitKind kind, uint8_t type,
                                            uint16_t known_flags, std::string& reason);
// Whether there are as many bytes as the header says.
bool check_unit_size(std::span<const uint8_t> bytes, const UnitHeader& header, std::string& reason);

// What read() returns, or nothing and in *reason (may be null) the text of the Error that it throws.
template <typename F>
auto or_reason(std::string* reason, F read) -> std::optional<decltype(read())> {
  try {
    return read();
  } catch (const Error& error) {
    if (reason) *reason = error.what();
    return std::nullopt;
  }
}

// RFC 1950 (zlib), at the fastest setting: what is coded so is small and made for every picture.
std::vector<uint8_t> deflate_all(std::span<const uint8_t> bytes);
// The zlib format for those to whom bytes cost nothing: the bytes as they are, in blocks that are not compressed.
std::vector<uint8_t> store_all(std::span<const uint8_t> bytes);
// Throws Error if the bytes are not those of exactly `size` bytes. Reserves no more memory than so few
// bytes can hold.
std::vector<uint8_t> inflate_exactly(std::span<const uint8_t> deflated, size_t size);

}  // namespace lf::wire
