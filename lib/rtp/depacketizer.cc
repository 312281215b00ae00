// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/depacketizer.h"

#include "wire/answer_parser.h"
#include "wire/request_codec.h"

namespace lf::rtp {

void Depacketizer::clear() {
  sources_.clear();
  reassembly_.clear();
}

Depacketizer::Stats Depacketizer::stats() const {
  Stats stats = stats_;
  stats.incomplete_units = reassembly_.dropped();
  return stats;
}

bool Depacketizer::is_new_request(Source& source, uint32_t view_id, uint32_t sequence) {
  std::optional<uint32_t>& last = source.requests[view_id];
  if (last) {
    const auto ahead = static_cast<int32_t>(sequence - *last);
    if (ahead <= 0 && ahead > -kMaxRequestAge) {
      stats_.repeated++;
      return false;
    }
  }
  last = sequence;
  return true;
}

bool Depacketizer::is_sound(Source& source, std::span<const uint8_t> bytes, const wire::UnitHeader& header) {
  if (header.version != wire::kVersion) return true;
  if (kind_ == wire::UnitKind::kRequest && header.type == wire::kViewRequestType) {
    const std::optional<ViewRequest> request = wire::decode_request(bytes);
    if (request) return is_new_request(source, request->view_id, request->sequence);
  } else if (kind_ == wire::UnitKind::kAnswer && header.type == wire::kFragmentsType) {
    if (wire::parse_answer(bytes)) return true;
  } else {
    return true;
  }
  stats_.bad_units++;
  return false;
}

void Depacketizer::take_units(Source& source, std::span<const uint8_t> bytes, const Deliver& deliver) {
  while (!bytes.empty()) {
    const std::optional<wire::UnitHeader> header = wire::peek_unit(bytes);
    if (!header || header->kind != kind_ || header->size > bytes.size()) {
      stats_.bad_units++;
      return;
    }
    const std::span<const uint8_t> unit = bytes.first(header->size);
    bytes = bytes.subspan(header->size);
    if (!is_sound(source, unit, *header)) continue;
    stats_.units++;
    deliver(unit, nullptr);
  }
}

void Depacketizer::take_chunk(Source& source, uint32_t id, const Chunk& chunk, const Deliver& deliver) {
  stats_.chunks++;
  ByteBuffer unit;
  switch (reassembly_.add(id, chunk, unit)) {
    case Reassembly::Result::kKept: return;
    case Reassembly::Result::kDuplicate: stats_.duplicates++; return;
    case Reassembly::Result::kBad:
    case Reassembly::Result::kTooLarge: stats_.bad_chunks++; return;
    case Reassembly::Result::kComplete: break;
  }
  const std::optional<wire::UnitHeader> header = wire::peek_unit(unit);
  if (!header || header->kind != kind_ || header->size != unit.size()) {
    stats_.bad_units++;
    return;
  }
  if (!is_sound(source, unit, *header)) return;
  stats_.units++;
  deliver(unit, &unit);
}

void Depacketizer::push(const Packet& packet, const Deliver& deliver) {
  stats_.packets++;
  stats_.bytes += packet.payload.size();
  const std::optional<ParsedPayload> parsed = parse_payload(packet.payload);
  if (!parsed) {
    stats_.bad_packets++;
    return;
  }
  Source& source = sources_[packet.source];
  const uint64_t lost = source.window.lost();
  const SequenceWindow::Verdict verdict = source.window.add(packet.sequence, packet.timestamp);
  stats_.lost += source.window.lost() - lost;  // less than before if a late one has come
  if (verdict == SequenceWindow::Verdict::kDuplicate) {
    stats_.duplicates++;
    return;
  }
  if (verdict == SequenceWindow::Verdict::kRestarted) source.requests.clear();
  if (parsed->chunk)
    take_chunk(source, packet.source, *parsed->chunk, deliver);
  else
    take_units(source, parsed->units, deliver);
}

}  // namespace lf::rtp
