// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "base/error.h"
#include "wire/bytes.h"
#include "wire/limits.h"

// What both streams have in common: a unit begins with magic, version, type, flags and its whole length. This frame is
// the same in every version of the format, so that units of a later one can be told apart and passed on.
namespace lf::wire {

enum class UnitKind { kRequest, kAnswer };
inline constexpr size_t kUnitHeaderBytes = 12;

// The first three bytes of both kinds' magic, for those who search a stream for one; the fourth is 'Q' or 'A'.
inline constexpr uint8_t kMagicPrefix[3] = {0x8f, 'L', 'F'};
inline constexpr uint8_t kRequestMagic = 'Q', kAnswerMagic = 'A';

// Types of units, see spec.md. Others are passed on by whoever only frames.
// Types in a request stream.
inline constexpr uint8_t kViewRequestType = 1, kWarpCommandType = 3, kPixelCommandType = 4;
inline constexpr uint8_t kFragmentsType = 1, kMomentsType = 5;  // types in an answer stream

struct UnitHeader {
  UnitKind kind;
  size_t size;  // bytes of the whole unit, header included; within limits.h
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

}  // namespace lf::wire
