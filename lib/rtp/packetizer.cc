// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/packetizer.h"

#include <algorithm>
#include <cstring>

#include "wire/answer_codec.h"
#include "wire/request_codec.h"
#include "wire/unit.h"

namespace lf::rtp {
namespace {

uint8_t first_byte(PacketKind kind) { return static_cast<uint8_t>(kPayloadVersion << 4 | static_cast<uint8_t>(kind)); }

}  // namespace

void put_units_header(uint8_t* to) {
  wire::BufferWriter out(to);
  out.put(first_byte(PacketKind::kUnits));
  out.put(uint8_t{0});
}

void put_chunk_header(uint8_t* to, const Chunk& chunk) {
  wire::BufferWriter out(to);
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

namespace {

std::vector<Piece> cut(const wire::AnswerView& answer, size_t max_payload, bool tiles) {
  std::vector<Piece> pieces;
  for (size_t i = 0; i < answer.fragments.size(); i++) {
    const wire::FragmentView& fragment = answer.fragments[i];
    const size_t bytes = fragment.payload.size();
    const std::optional<wire::Tiling> tiling =
        tiles && bytes > max_payload ? wire::tile_raw(fragment, max_payload) : std::nullopt;
    if (!tiling) {
      pieces.push_back({i, {}, bytes});
      continue;
    }
    for (size_t t = 0; t < tiling->count(); t++) {
      const Rect tile = tiling->tile(t);
      pieces.push_back({i, tile, wire::raw_size(wire::tile_header(fragment, tile))});
    }
  }
  return pieces;
}

Payload units_payload(std::vector<std::span<const uint8_t>> units, bool last) {
  Payload payload{.header_bytes = kUnitsHeaderBytes, .bytes = std::move(units), .last = last};
  put_units_header(payload.header.data());
  return payload;
}

}  // namespace

std::optional<PartPlan> plan_parts(const wire::AnswerView& answer, size_t max_bytes) {
  const size_t header = wire::table_offset(answer);
  if (header > max_bytes / 2) return std::nullopt;
  const size_t room = max_bytes - header;
  const bool whole = answer.part.whole();

  PartPlan plan;
  plan.pieces = cut(answer, room - wire::kFragmentBytes, whole);
  if (plan.pieces.size() > wire::kMaxFragments) plan.pieces = cut(answer, room, false);
  plan.total = whole ? static_cast<uint32_t>(plan.pieces.size()) : answer.part.total;

  bool even = true;  // parity of the next payload's offset
  for (size_t i = 0; i < plan.pieces.size(); i++) {
    const Piece& piece = plan.pieces[i];
    const size_t bytes = piece.bytes + wire::kFragmentBytes;
    const bool misplaced = answer.fragments[piece.fragment].codec == wire::Codec::kRaw16 && !even;
    if (plan.parts.empty() || misplaced || plan.parts.back().bytes + bytes > max_bytes) {
      plan.parts.push_back({.first = i, .bytes = header});
      even = true;
    }
    Part& part = plan.parts.back();
    part.count++;
    part.bytes += bytes;
    even ^= piece.bytes % 2 != 0;
  }
  if (plan.parts.empty()) plan.parts.push_back({.bytes = header});
  return plan;
}

ByteBuffer write_part(const wire::AnswerView& answer, const PartPlan& plan, const Part& part, ByteBuffer memory) {
  wire::AnswerWriter writer(answer, part.count, std::move(memory));
  writer.set_part(answer.part.first + static_cast<uint32_t>(part.first), plan.total);
  for (const Piece& piece : std::span(plan.pieces).subspan(part.first, part.count)) {
    const wire::FragmentView& fragment = answer.fragments[piece.fragment];
    if (piece.tile) {
      wire::copy_tile(fragment, *piece.tile, writer.add(wire::tile_header(fragment, *piece.tile)).data());
      continue;
    }
    writer.add(fragment, [&](ByteBuffer& out) { append(out, fragment.payload); });
  }
  return writer.finish();
}

size_t Payload::size() const {
  size_t size = header_bytes;
  for (const std::span<const uint8_t> piece : bytes) size += piece.size();
  return size;
}

void Payload::copy_to(uint8_t* to) const {
  to = std::copy_n(header.begin(), header_bytes, to);
  for (const std::span<const uint8_t> piece : bytes) to = std::copy(piece.begin(), piece.end(), to);
}

void Packetizer::send(Bytes unit, size_t max_payload, bool last, const Emit& emit) {
  if (unit.size() + kUnitsHeaderBytes <= max_payload) {
    stats_.parts++;
    emit(units_payload({unit}, last));
    return;
  }
  // Chunks of equal size avoid a small last chunk.
  const size_t most = max_payload - kChunkHeaderBytes;
  const size_t count = (unit.size() + most - 1) / most, size = (unit.size() + count - 1) / count;
  const uint16_t number = next_unit_++;
  for (size_t offset = 0; offset < unit.size(); offset += size) {
    const Bytes bytes = unit.subspan(offset, std::min(size, unit.size() - offset));
    Payload payload{
        .header_bytes = kChunkHeaderBytes, .bytes = {bytes}, .last = last && offset + bytes.size() == unit.size()};
    put_chunk_header(payload.header.data(),
                     {number, static_cast<uint32_t>(offset), static_cast<uint32_t>(unit.size()), bytes});
    stats_.chunks++;
    emit(payload);
  }
}

void Packetizer::send_request(Bytes unit, uint32_t view_id, size_t max_payload, const Emit& emit) {
  std::vector<std::vector<uint8_t>>& before = requests_[view_id];
  if (unit.size() + kUnitsHeaderBytes > max_payload) {
    send(unit, max_payload, true, emit);
  } else {
    std::vector<Bytes> units{unit};
    size_t size = kUnitsHeaderBytes + unit.size();
    for (auto i = before.rbegin(); i != before.rend() && size + i->size() <= max_payload; ++i) {
      size += i->size();
      units.insert(units.begin(), *i);
    }
    stats_.parts++;
    emit(units_payload(std::move(units), true));
  }
  if (before.size() == kRepeatedRequests) before.erase(before.begin());
  before.emplace_back(unit.begin(), unit.end());
}

void Packetizer::send_answer(Bytes unit, const wire::AnswerView& answer, size_t max_payload, const Emit& emit) {
  const bool last = answer.part.first + answer.part.count == answer.part.total;
  const std::optional<PartPlan> plan = unit.size() + kUnitsHeaderBytes <= max_payload
                                           ? std::nullopt
                                           : plan_parts(answer, max_payload - kUnitsHeaderBytes);
  if (!plan) {
    send(unit, max_payload, last, emit);
    return;
  }
  stats_.tiles += static_cast<uint64_t>(
      std::ranges::count_if(plan->pieces, [](const Piece& piece) { return piece.tile.has_value(); }));
  for (const Part& part : plan->parts) {
    part_ = write_part(answer, *plan, part, std::move(part_));
    send(part_, max_payload, last && &part == &plan->parts.back(), emit);
  }
}

bool Packetizer::packetize(std::span<const uint8_t> unit, size_t max_payload, const Emit& emit, std::string* reason) {
  const std::optional<wire::UnitHeader> header = wire::peek_unit(unit);
  if (!header || header->kind != kind_ || header->size != unit.size()) {
    if (reason) *reason = "the bytes must be exactly one unit of this stream";
    return false;
  }
  if (header->version != wire::kVersion) {
    send(unit, max_payload, true, emit);
  } else if (kind_ == wire::UnitKind::kRequest && header->type == wire::kViewRequestType) {
    const std::optional<ViewRequest> request = wire::decode_request(unit, reason);
    if (!request) return false;
    send_request(unit, request->view_id, max_payload, emit);
  } else if (kind_ == wire::UnitKind::kAnswer && header->type == wire::kFragmentsType) {
    const std::optional<wire::AnswerView> answer = wire::parse_answer(unit, reason);
    if (!answer) return false;
    send_answer(unit, *answer, max_payload, emit);
  } else {
    send(unit, max_payload, true, emit);
  }
  stats_.units++;
  return true;
}

}  // namespace lf::rtp
