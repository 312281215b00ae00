// SPDX-License-Identifier: LGPL-2.1-or-later
// Units into packets of any size and out of them again: every packet is small enough, and every fragment comes once.
#include <vector>

#include "fuzz/repair.h"
#include "rtp/depacketizer.h"
#include "rtp/packetizer.h"

using lf::fuzz::require;
using lf::wire::UnitKind;

LF_FUZZ_ANSWERS(2)

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
