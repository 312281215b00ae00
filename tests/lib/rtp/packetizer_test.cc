// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/packetizer.h"

#include <gtest/gtest.h>

#include "lib/rtp/rtp_test.h"
#include "lib/wire/wire_test.h"
#include "wire/limits.h"

namespace lf::rtp {
namespace {

using wire::UnitKind;

// The units in a packet without chunks.
std::vector<Bytes> units_in(const Bytes& payload) {
  std::vector<Bytes> units;
  const std::optional<ParsedPayload> parsed = parse_payload(payload);
  if (!parsed || parsed->chunk) return units;
  for (std::span<const uint8_t> rest = parsed->units; !rest.empty();) {
    const size_t size = wire::peek_unit(rest).value().size;
    units.push_back(to_bytes(rest.first(size)));
    rest = rest.subspan(size);
  }
  return units;
}

TEST(Packetizer, AnAnswerThatFitsIsSentAsItIs) {
  for (const Bytes& unit : {answer(0, 1, 1, 0), answer(2, 16, 16, 80), answer(1, 20, 20, 0)}) {
    const std::vector<Sent> packets = packetize(UnitKind::kAnswer, unit, 1388);
    ASSERT_EQ(packets.size(), 1u);
    EXPECT_TRUE(packets[0].last);
    EXPECT_EQ(units_in(packets[0].payload), std::vector<Bytes>{unit});
    EXPECT_EQ(packetize(UnitKind::kAnswer, unit, unit.size() + 2).size(), 1u);
  }
}

TEST(Packetizer, PartsAreAnswersThatCountTheirFragments) {
  CameraRanges cameras;
  cameras.append({0, 31});
  cameras.append({40, 50});
  for (const size_t max_payload : {400, 700, 1388, 8900}) {
    const Bytes unit = answer(60, 40, 30, 75, PixelFamily::kI420, cameras);
    const wire::AnswerView whole = wire::parse_answer(unit).value();
    const std::vector<Sent> packets = packetize(UnitKind::kAnswer, unit, max_payload);
    uint32_t next = 0;
    std::vector<wire::FragmentView> got;
    std::vector<Bytes> parts;
    parts.reserve(packets.size());
    Reassembly reassembly{{}};
    for (size_t i = 0; i < packets.size(); i++) {
      EXPECT_LE(packets[i].payload.size(), max_payload);
      EXPECT_EQ(packets[i].last, i + 1 == packets.size());
      const ParsedPayload parsed = parse_payload(packets[i].payload).value();
      ByteBuffer made;
      if (!parsed.chunk)
        parts.push_back(to_bytes(parsed.units));
      else if (reassembly.add(1, *parsed.chunk, made) == Reassembly::Result::kComplete)
        parts.push_back(to_bytes(made));
      else
        continue;
      std::string reason;
      const std::optional<wire::AnswerView> part = wire::parse_answer(parts.back(), &reason);
      ASSERT_TRUE(part.has_value()) << reason;
      EXPECT_EQ(static_cast<const wire::AnswerHeader&>(*part), static_cast<const wire::AnswerHeader&>(whole));
      EXPECT_EQ(part->part, (wire::AnswerPart{next, part->part.count, 60}));
      next += part->part.count;
      got.insert(got.end(), part->fragments.begin(), part->fragments.end());
    }
    EXPECT_EQ(reassembly.units(), 0u);
    ASSERT_EQ(got.size(), whole.fragments.size());
    for (size_t i = 0; i < got.size(); i++) {
      EXPECT_EQ(static_cast<wire::FragmentHeader&>(got[i]), whole.fragments[i]);
      EXPECT_TRUE(std::ranges::equal(got[i].payload, whole.fragments[i].payload)) << i;
    }
  }
}

TEST(Packetizer, RawFragmentsBecomeTilesThatFit) {
  const Bytes units[] = {answer_with_sum(399, 301, false, 3), answer_with_sum(30, 201, true, 40),
                         answer(2, 200, 150, 0), answer(3, 390, 40, 0, PixelFamily::kRgb)};
  for (const Bytes& unit : units) {
    for (const size_t max_payload : {kMinPayloadBytes, size_t{1388}}) {
      Packetizer packetizer(UnitKind::kAnswer);
      const wire::AnswerView whole = wire::parse_answer(unit).value();
      Samples expected, got;
      add_samples(whole, expected);
      uint32_t next = 0, total = 0;
      for (const Sent& packet : packetize(packetizer, unit, max_payload)) {
        EXPECT_LE(packet.payload.size(), max_payload);
        const std::vector<Bytes> parts = units_in(packet.payload);
        if (parts.empty()) continue;  // a JPEG larger than the smallest packets
        ASSERT_EQ(parts.size(), 1u);
        std::string reason;
        const std::optional<wire::AnswerView> part = wire::parse_answer(parts[0], &reason);
        ASSERT_TRUE(part.has_value()) << reason;
        EXPECT_GE(part->part.first, next);
        next = part->part.first + part->part.count;
        total = part->part.total;
        add_samples(*part, got);
      }
      EXPECT_LE(next, total);
      EXPECT_GT(packetizer.stats().tiles, 10u);
      std::ranges::sort(expected);
      std::ranges::sort(got);
      EXPECT_EQ(got, expected);
    }
  }
}

TEST(Packetizer, WhatIsLargerThanAPacketGoesInChunks) {
  Packetizer packetizer(UnitKind::kAnswer);
  const Bytes unit = answer(1, 390, 390, 90);
  const std::vector<Sent> packets = packetize(packetizer, unit, 1388);
  ASSERT_GT(packets.size(), 3u);
  Bytes joined;
  for (size_t i = 0; i < packets.size(); i++) {
    EXPECT_EQ(packets[i].last, i + 1 == packets.size());
    const ParsedPayload parsed = parse_payload(packets[i].payload).value();
    ASSERT_TRUE(parsed.chunk.has_value());
    EXPECT_EQ(parsed.chunk->offset, joined.size());
    EXPECT_EQ(parsed.chunk->size, unit.size());
    EXPECT_EQ(parsed.chunk->unit, 0);
    EXPECT_GT(packets[i].payload.size(), 1388u / 2);
    joined.insert(joined.end(), parsed.chunk->bytes.begin(), parsed.chunk->bytes.end());
  }
  EXPECT_EQ(joined, unit);
  EXPECT_EQ(parse_payload(packetize(packetizer, unit, 1388)[0].payload)->chunk->unit, 1);
}

TEST(Packetizer, PartsStayParts) {
  // A raw fragment in a part of an answer can't be cut: the other parts would count wrongly.
  const wire::AnswerHeader header = wire::header_of_view(PixelFamily::kRgb, 400, 400);
  wire::AnswerWriter writer(header, 2);
  writer.set_part(3, 7);
  writer.add({1, header.family, {0, 0, 100, 100}, wire::Codec::kRaw, 0, false});
  writer.add({2, header.family, {0, 0, 10, 10}, wire::Codec::kRaw, 0, false});
  const std::vector<Sent> packets = packetize(UnitKind::kAnswer, to_bytes(writer.finish()), 1388);
  EXPECT_EQ(std::ranges::count_if(packets, &Sent::last), 0);  // others follow
  const wire::AnswerPartHeader last = wire::parse_answer_header(units_in(packets.back().payload).at(0)).value();
  EXPECT_EQ(last.part, (wire::AnswerPart{4, 1, 7}));
}

TEST(Packetizer, AHeaderOfManyRangesGoesInChunks) {
  CameraRanges cameras;
  for (CameraIndex i = 0; i < 400; i++) cameras.append({2 * i, 2 * i});
  const Bytes unit = answer(3, 30, 30, 80, PixelFamily::kI420, cameras);
  for (const Sent& packet : packetize(UnitKind::kAnswer, unit, 1388)) EXPECT_TRUE(units_in(packet.payload).empty());
}

TEST(Packetizer, TooManyTilesGoInChunks) {
  const wire::AnswerHeader header = wire::header_of_view(PixelFamily::kRgb, 4096, 4096);
  wire::AnswerWriter writer(header, 1);
  writer.add({1, header.family, {0, 0, 4096, 4096}, wire::Codec::kRaw, 0, false});
  Packetizer packetizer(UnitKind::kAnswer);
  packetize(packetizer, to_bytes(writer.finish()), kMinPayloadBytes);
  EXPECT_EQ(packetizer.stats().tiles, 0u);
  EXPECT_GT(packetizer.stats().chunks, 1000u);
}

TEST(Packetizer, RequestsTakeTheirTwoPredecessorsAlong) {
  Packetizer packetizer(UnitKind::kRequest);
  const auto units = [&](const Bytes& unit, size_t max_payload = 1388) {
    const std::vector<Sent> packets = packetize(packetizer, unit, max_payload);
    EXPECT_EQ(packets.size(), 1u);
    EXPECT_TRUE(packets[0].last);
    return units_in(packets[0].payload);
  };
  EXPECT_EQ(units(request(1)), (std::vector<Bytes>{request(1)}));
  EXPECT_EQ(units(request(2)), (std::vector<Bytes>{request(1), request(2)}));
  EXPECT_EQ(units(request(7, 5)), (std::vector<Bytes>{request(7, 5)}));  // another view
  EXPECT_EQ(units(request(3)), (std::vector<Bytes>{request(1), request(2), request(3)}));
  EXPECT_EQ(units(request(4)), (std::vector<Bytes>{request(2), request(3), request(4)}));
  EXPECT_EQ(units(request(8, 5)), (std::vector<Bytes>{request(7, 5), request(8, 5)}));
  const size_t size = request(5).size();
  EXPECT_EQ(units(request(5), 2 * size + 2), (std::vector<Bytes>{request(4), request(5)}));  // as many as fit
  EXPECT_EQ(units(request(6), 2 * size + 1), (std::vector<Bytes>{request(6)}));
  packetizer.clear();
  EXPECT_EQ(units(request(9)), (std::vector<Bytes>{request(9)}));
  // Larger than a packet.
  const std::vector<Sent> packets = packetize(packetizer, request(10, 0, 2000), 1388);
  ASSERT_EQ(packets.size(), 4u);
  for (size_t i = 0; i < 4; i++) EXPECT_EQ(packets[i].last, i == 3);
}

TEST(Packetizer, UnitsOfVersionsToComeGoAsTheyAre) {
  Bytes unit = answer(1, 60, 60, 0);
  unit[4] = 9;
  EXPECT_EQ(packetize(UnitKind::kAnswer, unit, 100000).size(), 1u);
  EXPECT_GT(packetize(UnitKind::kAnswer, unit, 1388).size(), 3u);
  unit[4] = wire::kVersion;
  unit[5] = 77;
  EXPECT_EQ(packetize(UnitKind::kAnswer, unit, 100000).size(), 1u);
}

TEST(Packetizer, RefusesWhatIsNoSoundUnit) {
  const auto reason_of = [](UnitKind kind, const Bytes& unit) {
    std::string reason;
    Packetizer packetizer(kind);
    EXPECT_FALSE(packetizer.packetize(
        unit, 1388, [](const Payload&) { ADD_FAILURE(); }, &reason));
    EXPECT_EQ(packetizer.stats().units, 0u);
    return reason;
  };
  const Bytes good = answer(1, 20, 20, 0);
  const char* const no_unit = "not exactly one unit of this stream";
  EXPECT_EQ(reason_of(UnitKind::kAnswer, {}), no_unit);
  EXPECT_EQ(reason_of(UnitKind::kAnswer, Bytes(100, 'x')), no_unit);
  EXPECT_EQ(reason_of(UnitKind::kAnswer, request(1)), no_unit);
  EXPECT_EQ(reason_of(UnitKind::kRequest, good), no_unit);
  EXPECT_EQ(reason_of(UnitKind::kAnswer, {good.begin(), good.end() - 1}), no_unit);
  EXPECT_EQ(reason_of(UnitKind::kAnswer, wire::with(good, 48, 2, 0)), "view_width: must be 1 to 16384 pixels, is 0");
  EXPECT_EQ(reason_of(UnitKind::kRequest, wire::with(request(1), 36, 2, 0)).empty(), false);
}

}  // namespace
}  // namespace lf::rtp
