// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

// What stands behind the RTP header of a packet; see spec.md.
namespace lf::rtp {

inline constexpr uint32_t kClockRate = 90000;
inline constexpr uint8_t kPayloadVersion = 1;

enum class PacketKind : uint8_t {
  kUnits = 0,  // whole units of the wire format, one after the other
  kChunk = 1,  // a piece of a unit that is larger than a packet
};

inline constexpr size_t kUnitsHeaderBytes = 2, kChunkHeaderBytes = 12;

// Payloads are never smaller than this: a part of an answer has to fit in one with a few pixels.
inline constexpr size_t kMinPayloadBytes = 256;

struct Chunk {
  uint16_t unit = 0;    // number of the unit: one more for each that is sent in chunks; wraps
  uint32_t offset = 0;  // where in the unit `bytes` begin
  uint32_t size = 0;    // bytes of the whole unit
  std::span<const uint8_t> bytes;
};

// These write the header in front of units or of a chunk's bytes.
void put_units_header(uint8_t* to);
void put_chunk_header(uint8_t* to, const Chunk& chunk);

// What a sound payload has, units or a chunk, where it lies; units are not looked at, but there is at least one byte.
struct ParsedPayload {
  std::span<const uint8_t> units;
  std::optional<Chunk> chunk;
};
// Nothing for payloads that are cut short, of another version or an unknown kind, and for chunks beyond their unit.
std::optional<ParsedPayload> parse_payload(std::span<const uint8_t> payload);

}  // namespace lf::rtp
