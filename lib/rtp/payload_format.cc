// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/payload_format.h"

#include "wire/bytes.h"
#include "wire/unit.h"

namespace lf::rtp {
namespace {

uint8_t first_byte(PacketKind kind) { return static_cast<uint8_t>(kPayloadVersion << 4 | static_cast<uint8_t>(kind)); }

}  // namespace

void put_units_header(uint8_t* to) {
  wire::PlacedWriter out(to);
  out.put(first_byte(PacketKind::kUnits));
  out.put(uint8_t{0});
}

void put_chunk_header(uint8_t* to, const Chunk& chunk) {
  wire::PlacedWriter out(to);
  out.put(first_byte(PacketKind::kChunk));
  out.put(uint8_t{0});
  out.put(chunk.unit);
  out.put(chunk.offset);
  out.put(chunk.size);
}

std::optional<ParsedPayload> parse_payload(std::span<const uint8_t> payload) {
  wire::Reader in(payload);
  const uint8_t first = in.get<uint8_t>(), reserved = in.get<uint8_t>();
  if (!in.ok() || reserved != 0) return std::nullopt;
  ParsedPayload out;
  if (first == first_byte(PacketKind::kUnits)) {
    out.units = in.get_bytes(in.left());
    return out.units.empty() ? std::nullopt : std::optional(out);
  }
  if (first != first_byte(PacketKind::kChunk)) return std::nullopt;
  Chunk chunk;
  chunk.unit = in.get<uint16_t>();
  chunk.offset = in.get<uint32_t>();
  chunk.size = in.get<uint32_t>();
  if (!in.ok() || in.left() == 0 || chunk.size < wire::kUnitHeaderBytes) return std::nullopt;
  if (chunk.offset > chunk.size || in.left() > chunk.size - chunk.offset) return std::nullopt;
  chunk.bytes = in.get_bytes(in.left());
  out.chunk = chunk;
  return out;
}

}  // namespace lf::rtp
