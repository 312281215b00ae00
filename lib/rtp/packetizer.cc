// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/packetizer.h"

#include <algorithm>
#include <cstring>

#include "rtp/part_plan.h"
#include "wire/request_codec.h"

namespace lf::rtp {
namespace {

Payload units_payload(std::vector<std::span<const uint8_t>> units, bool last) {
  Payload payload{.header_bytes = kUnitsHeaderBytes, .bytes = std::move(units), .last = last};
  put_units_header(payload.header.data());
  return payload;
}

}  // namespace

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
  // Chunks as large as one another: no small one at the end.
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
  if (before.size() == kPredecessors) before.erase(before.begin());
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
    if (reason) *reason = "not exactly one unit of this stream";
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
