// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/depacketizer.h"

#include <algorithm>
#include <utility>

#include "wire/answer_codec.h"
#include "wire/request_codec.h"

namespace lf::rtp {

void SequenceWindow::restart(uint16_t sequence, uint32_t timestamp) {
  slots_.fill({});
  started_ = true;
  restart_at_.reset();
  newest_ = sequence;
  slot(sequence) = {State::kSeen, timestamp};
}

SequenceWindow::Verdict SequenceWindow::add(uint16_t sequence, uint32_t timestamp) {
  if (!started_) {
    restart(sequence, timestamp);
    return Verdict::kNew;
  }
  const int ahead = static_cast<int16_t>(static_cast<uint16_t>(sequence - newest_));
  if (ahead > kMaxJump || ahead <= -kSize) {
    if (restart_at_ == sequence) {
      restart(sequence, timestamp);
      return Verdict::kRestarted;
    }
    restart_at_ = static_cast<uint16_t>(sequence + 1);
    return Verdict::kNew;
  }
  restart_at_.reset();
  if (ahead > 0) {
    lost_ += static_cast<uint64_t>(ahead - 1);
    for (int i = std::max(1, ahead - kSize + 1); i < ahead; i++)
      slot(static_cast<uint16_t>(newest_ + i)) = {State::kMissing, 0};
    newest_ = sequence;
  } else {
    const Slot& old = slot(sequence);
    if (old.state == State::kSeen) {
      if (old.timestamp == timestamp) return Verdict::kDuplicate;
      restart(sequence, timestamp);
      return Verdict::kRestarted;
    }
    if (old.state == State::kMissing) lost_--;
  }
  slot(sequence) = {State::kSeen, timestamp};
  return Verdict::kNew;
}

void Reassembly::drop_oldest() {
  bytes_ -= partial_units_.front().cost();
  partial_units_.erase(partial_units_.begin());
  dropped_++;
}

void Reassembly::clear() {
  while (!partial_units_.empty()) drop_oldest();
}

ByteBuffer Reassembly::finish(PartialUnit& making) {
  if (making.in_order) return std::move(making.bytes);
  ByteBuffer unit;
  unit.reserve(making.size);
  for (const auto& [offset, place] : making.chunks) append(unit, std::span(making.bytes).subspan(place.at, place.size));
  return unit;
}

Reassembly::Result Reassembly::add(uint32_t source, const Chunk& chunk, ByteBuffer& unit) {
  if (chunk.size > limits_.bytes) return Result::kTooLarge;
  auto found = std::ranges::find_if(partial_units_, [&](const PartialUnit& making) {
    return making.source == source && making.number == chunk.unit;
  });
  const uint32_t end = chunk.offset + static_cast<uint32_t>(chunk.bytes.size());
  if (found != partial_units_.end()) {
    if (found->size != chunk.size) return Result::kBad;
    const auto next = found->chunks.lower_bound(chunk.offset);
    if (next != found->chunks.end()) {
      if (next->first == chunk.offset && next->second.size == chunk.bytes.size()) return Result::kDuplicate;
      if (next->first < end) return Result::kBad;
    }
    if (next != found->chunks.begin()) {
      const auto before = std::prev(next);
      if (before->first + before->second.size > chunk.offset) return Result::kBad;
    }
  } else {
    if (partial_units_.size() >= limits_.units) drop_oldest();
    partial_units_.push_back({source, chunk.unit, chunk.size});
    found = partial_units_.end() - 1;
  }
  if (found->bytes.size() != chunk.offset) found->in_order = false;
  found->chunks.emplace(chunk.offset, Place{chunk.bytes.size(), found->bytes.size()});
  append(found->bytes, chunk.bytes);
  bytes_ += chunk.bytes.size() + kChunkCost;
  if (found->bytes.size() == found->size) {
    bytes_ -= found->cost();
    unit = finish(*found);
    partial_units_.erase(found);
    return Result::kComplete;
  }
  while (bytes_ > limits_.bytes && !partial_units_.empty()) drop_oldest();
  return Result::kKept;
}

void Depacketizer::clear() {
  sources_.clear();
  reassembly_.clear();
}

Depacketizer::Stats Depacketizer::stats() const {
  Stats stats = stats_;
  stats.incomplete_units = reassembly_.dropped();
  return stats;
}

// A restarted viewer may repeat sequence numbers, but with later target times.
bool Depacketizer::is_repeated(Source& source, const RequestHeader& head) {
  const std::optional<Source::Request>& last = source.requests[head.view_id];
  if (!last) return false;
  const auto ahead = static_cast<int32_t>(head.sequence - last->sequence);
  const bool is_later =
      head.target_time != kNoTime && last->target_time != kNoTime && head.target_time > last->target_time;
  return ahead <= 0 && ahead > -kMaxRequestAge && !is_later;
}

bool Depacketizer::is_sound_request(Source& source, Bytes bytes) {
  const std::optional<wire::RequestPeek> peek = wire::peek_request(bytes);
  if (peek && is_repeated(source, peek->head)) {
    stats_.repeated++;
    return false;
  }
  if (peek && filter_ && !filter_(bytes)) return false;
  if (!peek || !wire::decode_request(bytes)) {
    stats_.bad_units++;
    return false;
  }
  source.requests[peek->head.view_id] = Source::Request{peek->head.sequence, peek->head.target_time};
  return true;
}

bool Depacketizer::is_sound(Source& source, Bytes bytes, const wire::UnitHeader& header) {
  if (header.version != wire::kVersion) return true;
  if (kind_ == wire::UnitKind::kRequest && header.type == wire::kViewRequestType)
    return is_sound_request(source, bytes);
  if (filter_ && !filter_(bytes)) return false;
  if (kind_ == wire::UnitKind::kRequest || header.type != wire::kFragmentsType || wire::parse_answer(bytes))
    return true;
  stats_.bad_units++;
  return false;
}

void Depacketizer::take_unit(Source& source, Bytes bytes, const wire::UnitHeader& header, const Deliver& deliver) {
  if (!is_sound(source, bytes, header)) return;
  stats_.units++;
  deliver(bytes, nullptr);
}

void Depacketizer::keep_newest(std::vector<Bytes>& units) {
  if (units.size() <= kMaxRequestsPerPacket) return;
  const auto superseded = static_cast<ptrdiff_t>(units.size() - kMaxRequestsPerPacket);
  stats_.superseded += static_cast<uint64_t>(superseded);
  units.erase(units.begin(), units.begin() + superseded);
}

void Depacketizer::take_units(Source& source, Bytes bytes, const Deliver& deliver) {
  units_.clear();
  while (!bytes.empty()) {
    const std::optional<wire::UnitHeader> header = wire::peek_unit(bytes);
    if (!header || header->kind != kind_ || header->size > bytes.size()) {
      stats_.bad_units++;
      break;
    }
    units_.push_back(bytes.first(header->size));
    bytes = bytes.subspan(header->size);
  }
  if (kind_ == wire::UnitKind::kRequest) keep_newest(units_);
  for (const Bytes unit : units_) take_unit(source, unit, *wire::peek_unit(unit), deliver);
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
  stats_.lost += source.window.lost() - lost;  // decreases if a late packet arrived
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
