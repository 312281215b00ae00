// SPDX-License-Identifier: LGPL-2.1-or-later
#include <vector>

#include "fuzz/fuzz.h"
#include "fuzz/repair.h"
#include "rtp/depacketizer.h"
#include "rtp/packetizer.h"
#include "wire/answer_codec.h"
#include "wire/request_codec.h"

using lf::fuzz::require;
using lf::wire::UnitKind;

LF_FUZZ_ANSWERS(packetizer, 2)

// Units into packets of any size and back: no packet exceeds the limit, and every fragment arrives once.
LF_FUZZ_TARGET(packetizer)(const uint8_t* data, size_t size) {
  lf::fuzz::Input input(data, size);
  const uint32_t settings = input.number(2);
  const UnitKind kind = settings & 1 ? UnitKind::kRequest : UnitKind::kAnswer;
  const size_t max_payload = lf::rtp::kMinPayloadBytes + (settings >> 1) % 2000;
  const std::span<const uint8_t> unit = input.take(size);

  lf::rtp::Packetizer packetizer(kind);
  lf::rtp::Depacketizer depacketizer(kind);
  uint16_t sequence = 0;
  uint64_t units = 0, fragments = 0, total = 0;
  const bool taken = packetizer.packetize(unit, max_payload, [&](const lf::rtp::Payload& payload) {
    std::vector<uint8_t> bytes(payload.size());
    payload.copy_to(bytes.data());
    require(bytes.size() <= max_payload);
    depacketizer.push({1, sequence++, 0, bytes}, [&](std::span<const uint8_t> got, lf::ByteBuffer*) {
      units++;
      const std::optional<lf::wire::AnswerPartHeader> head = lf::wire::parse_answer_header(got);
      if (!head) return;
      fragments += head->part.count;
      total = head->part.total;
    });
  });
  const lf::rtp::Depacketizer::Stats stats = depacketizer.stats();
  require(stats.units == units && stats.bad_packets + stats.bad_chunks + stats.bad_units + stats.duplicates == 0);
  if (!taken) {
    require(sequence == 0);
    return 0;
  }
  require(units > 0);
  const std::optional<lf::wire::AnswerPartHeader> head = lf::wire::parse_answer_header(unit);
  if (head) require(head->part.whole() ? fragments == total : fragments == head->part.count);
  return 0;
}

// Packets with arbitrary contents from several senders: received units are valid, and memory stays bounded. Input: one
// byte of settings, then packets: sender and step of the sequence number, a length, a payload.
LF_FUZZ_TARGET(depacketizer)(const uint8_t* data, size_t size) {
  lf::fuzz::Input input(data, size);
  const UnitKind kind = input.number(1) & 1 ? UnitKind::kRequest : UnitKind::kAnswer;
  const lf::rtp::Reassembly::Limits limits{.bytes = 20000, .units = 4};
  lf::rtp::Depacketizer depacketizer(kind, limits);
  uint16_t sequence = 0;
  uint64_t units = 0, packets = 0;
  while (!input.empty()) {
    const uint32_t how = input.number(1);
    sequence = static_cast<uint16_t>(sequence + static_cast<int8_t>(how) / 16);
    const std::span<const uint8_t> payload = input.take(input.number(2) % 2048);
    packets++;
    depacketizer.push({how % 4, sequence, how & 4 ? static_cast<uint32_t>(packets) : 0u, payload},
                      [&](std::span<const uint8_t> bytes, lf::ByteBuffer*) {
                        units++;
                        const std::optional<lf::wire::UnitHeader> header = lf::wire::peek_unit(bytes);
                        require(header && header->kind == kind && header->size == bytes.size());
                        if (header->version != lf::wire::kVersion || header->type != 1) return;
                        require(kind == UnitKind::kRequest ? lf::wire::decode_request(bytes).has_value()
                                                           : lf::wire::parse_answer(bytes).has_value());
                      });
  }
  const lf::rtp::Depacketizer::Stats stats = depacketizer.stats();
  require(stats.packets == packets && stats.units == units);
  return 0;
}
