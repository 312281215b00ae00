// SPDX-License-Identifier: LGPL-2.1-or-later
// Packets of several senders, whatever they hold: what comes out is sound, and memory stays bounded. The input is a
// byte of settings and then packets: sender and a step of the sequence number, a length, a payload.
#include "fuzz/fuzz.h"
#include "rtp/depacketizer.h"
#include "wire/answer_parser.h"
#include "wire/request_codec.h"

using lf::fuzz::require;
using lf::wire::UnitKind;

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
