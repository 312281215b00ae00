// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/packetizer.h"
#include "lib/rtp/rtp_test.h"
#include "lib/wire/wire_test.h"
#include "support/fragments.h"
#include "wire/answer_codec.h"
#include "wire/unit.h"

namespace lf::rtp {
namespace {

using wire::from_hex;

TEST(PayloadFormat, GoldenBytes) {
  std::vector<uint8_t> units(kUnitsHeaderBytes), chunk(kChunkHeaderBytes);
  put_units_header(units.data());
  put_chunk_header(chunk.data(), {0x1234, 0x10000, 0x20000, {}});
  EXPECT_EQ(units, from_hex("1000"));
  EXPECT_EQ(chunk, from_hex("110012340001000000020000"));
}

TEST(PayloadFormat, RoundTrips) {
  const std::vector<uint8_t> units = from_hex("1000aabb");
  const ParsedPayload parsed = parse_payload(units).value();
  EXPECT_FALSE(parsed.chunk.has_value());
  EXPECT_EQ(parsed.units.data(), units.data() + 2);
  EXPECT_EQ(parsed.units.size(), 2u);

  const std::vector<uint8_t> bytes = from_hex("11001234000000100000001301ff03");
  const auto chunk = parse_payload(bytes).value().chunk.value();
  EXPECT_EQ(chunk.unit, 0x1234);
  EXPECT_EQ(chunk.offset, 16u);
  EXPECT_EQ(chunk.size, 19u);
  EXPECT_EQ(chunk.bytes.size(), 3u);
}

TEST(PayloadFormat, RefusesInvalidPayloads) {
  const std::pair<const char*, std::vector<const char*>> cases[] = {
      {"truncated", {"", "10", "1000", "11", "1100"}},
      {"reserved bits", {"1001aabb", "1101123400000000000000130a"}},
      {"version or kind", {"2000aabb", "0000aabb", "1200aabb", "ff00aabb"}},
      {"empty chunk", {"110012340000001000000013"}},
      {"half a header", {"1100123400000010000000"}},
      {"unit smaller than its header", {"11001234000000000000000baa"}},
      {"beyond the unit",
       {"11001234000000110000001301ff03", "1100123400000014000000130a", "11001234ffffffff000000130a",
        "11001234ffffffffffffffff0a"}},
  };
  for (const auto& [name, payloads] : cases)
    for (const char* hex : payloads) EXPECT_FALSE(parse_payload(from_hex(hex)).has_value()) << name << ": " << hex;
  EXPECT_TRUE(parse_payload(from_hex("11001234fffffffeffffffff0a")).has_value());
}

TEST(LruMap, ForgetsTheLeastRecentlyUsedKey) {
  LruMap<int> values(3);
  for (const uint32_t key : {10, 11, 12}) values[key] = static_cast<int>(key);
  EXPECT_EQ(values[10], 10);
  values[13] = 13;
  EXPECT_EQ(values.size(), 3u);
  EXPECT_EQ(values[10], 10);
  EXPECT_EQ(values[12], 12);
  EXPECT_EQ(values[13], 13);
  EXPECT_EQ(values[11], 0);
  values.clear();
  EXPECT_EQ(values[13], 0);
}

TEST(LruMap, ValuesDoNotMove) {
  LruMap<std::array<char, 8192>> values(64);
  const auto* first = &values[0];
  for (uint32_t key = 1; key < 64; key++) values[key];
  for (uint32_t key = 63; key > 0; key--) values[key];
  EXPECT_EQ(&values[0], first);
}

TEST(PartPlan, PartsAreFullAndHaveThePlannedSizes) {
  const Bytes unit = answer(60, 40, 30, 75);
  const wire::AnswerView view = wire::parsed(unit);
  const PartPlan plan = plan_parts(view, 1386).value();
  EXPECT_EQ(plan.total, 60u);
  size_t largest_piece = 0;
  for (const Piece& piece : plan.pieces) largest_piece = std::max(largest_piece, piece.bytes + 20);
  for (const Part& part : plan.parts) {
    EXPECT_EQ(write_part(view, plan, part, {}).size(), part.bytes);
    EXPECT_TRUE(part.count == 1 || part.bytes <= 1386u);
    EXPECT_TRUE(&part == &plan.parts.back() || part.bytes > 1386 - largest_piece);
  }
}

TEST(PartPlan, SixteenBitValuesStartAtEvenOffsets) {
  // Two JPEG payloads of odd lengths, then a sum: in separate parts the sum would be misaligned.
  const wire::AnswerHeader header = wire::header_of_view(PixelFamily::kRgb, 400, 400);
  wire::AnswerWriter writer(header, 3);
  for (int i = 0; i < 2; i++)
    writer.add({{}, header.family, {0, 0, 16, 16}, wire::Codec::kJpeg, 50, false},
               [](ByteBuffer& out) { append(out, Bytes(501, 0x55)); });
  writer.add({{}, header.family, {0, 0, 4, 4}, wire::Codec::kRaw16, 0, false});
  const Bytes unit = to_bytes(writer.finish());
  const wire::AnswerView view = wire::parsed(unit);
  const PartPlan plan = plan_parts(view, 800).value();
  EXPECT_EQ(plan.parts.size(), 3u);
  for (const Part& part : plan.parts) EXPECT_TRUE(wire::parse_answer(write_part(view, plan, part, {})).has_value());
}

TEST(PartPlan, EmptyAnswerHasOnePart) {
  const Bytes unit = answer(0, 1, 1, 0);
  const wire::AnswerView view = wire::parsed(unit);
  const std::optional<PartPlan> plan = plan_parts(view, 500);
  ASSERT_EQ(plan->parts.size(), 1u);
  EXPECT_EQ(to_bytes(write_part(view, *plan, plan->parts[0], {})), unit);
}

using wire::UnitKind;

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

TEST(Packetizer, AnswerThatFitsIsSentUnchanged) {
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
    const wire::AnswerView whole = wire::parsed(unit);
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
      const wire::AnswerView part = wire::parsed(parts.back());
      EXPECT_EQ(static_cast<const wire::AnswerHeader&>(part), static_cast<const wire::AnswerHeader&>(whole));
      EXPECT_EQ(part.part, (wire::AnswerPart{next, part.part.count, 60}));
      next += part.part.count;
      got.insert(got.end(), part.fragments.begin(), part.fragments.end());
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
      const wire::AnswerView whole = wire::parsed(unit);
      Samples expected, got;
      add_samples(whole, expected);
      uint32_t next = 0, total = 0;
      for (const Sent& packet : packetize(packetizer, unit, max_payload)) {
        EXPECT_LE(packet.payload.size(), max_payload);
        const std::vector<Bytes> parts = units_in(packet.payload);
        if (parts.empty()) continue;  // a JPEG larger than the smallest packets
        ASSERT_EQ(parts.size(), 1u);
        const wire::AnswerView part = wire::parsed(parts[0]);
        EXPECT_GE(part.part.first, next);
        next = part.part.first + part.part.count;
        total = part.part.total;
        add_samples(part, got);
      }
      EXPECT_LE(next, total);
      EXPECT_GT(packetizer.stats().tiles, 10u);
      std::ranges::sort(expected);
      std::ranges::sort(got);
      EXPECT_EQ(got, expected);
    }
  }
}

TEST(Packetizer, LargeUnitsAreSentInChunks) {
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

TEST(Packetizer, PartsAreSplitIntoParts) {
  // A raw fragment in a part of an answer cannot be split: the counts of the remaining parts would be wrong.
  const wire::AnswerHeader header = wire::header_of_view(PixelFamily::kRgb, 400, 400);
  wire::AnswerWriter writer(header, 2);
  writer.set_part(3, 7);
  writer.add({1, header.family, {0, 0, 100, 100}, wire::Codec::kRaw, 0, false});
  writer.add({2, header.family, {0, 0, 10, 10}, wire::Codec::kRaw, 0, false});
  const std::vector<Sent> packets = packetize(UnitKind::kAnswer, to_bytes(writer.finish()), 1388);
  EXPECT_EQ(std::ranges::count_if(packets, &Sent::last), 0);
  const wire::AnswerPartHeader last = wire::parse_answer_header(units_in(packets.back().payload).at(0)).value();
  EXPECT_EQ(last.part, (wire::AnswerPart{4, 1, 7}));
}

TEST(Packetizer, HeaderWithManyRangesIsSentInChunks) {
  CameraRanges cameras;
  for (CameraIndex i = 0; i < 400; i++) cameras.append({2 * i, 2 * i});
  const Bytes unit = answer(3, 30, 30, 80, PixelFamily::kI420, cameras);
  for (const Sent& packet : packetize(UnitKind::kAnswer, unit, 1388)) EXPECT_TRUE(units_in(packet.payload).empty());
}

TEST(Packetizer, TooManyTilesAreSentInChunks) {
  const wire::AnswerHeader header = wire::header_of_view(PixelFamily::kRgb, 4096, 4096);
  wire::AnswerWriter writer(header, 1);
  writer.add({1, header.family, {0, 0, 4096, 4096}, wire::Codec::kRaw, 0, false});
  Packetizer packetizer(UnitKind::kAnswer);
  packetize(packetizer, to_bytes(writer.finish()), kMinPayloadBytes);
  EXPECT_EQ(packetizer.stats().tiles, 0u);
  EXPECT_GT(packetizer.stats().chunks, 1000u);
}

TEST(Packetizer, RequestsRepeatTheirTwoPredecessors) {
  Packetizer packetizer(UnitKind::kRequest);
  const auto units = [&](const Bytes& unit, size_t max_payload = 1388) {
    const std::vector<Sent> packets = packetize(packetizer, unit, max_payload);
    EXPECT_EQ(packets.size(), 1u);
    EXPECT_TRUE(packets[0].last);
    return units_in(packets[0].payload);
  };
  EXPECT_EQ(units(request(1)), (std::vector<Bytes>{request(1)}));
  EXPECT_EQ(units(request(2)), (std::vector<Bytes>{request(1), request(2)}));
  EXPECT_EQ(units(request(7, 5)), (std::vector<Bytes>{request(7, 5)}));
  EXPECT_EQ(units(request(3)), (std::vector<Bytes>{request(1), request(2), request(3)}));
  EXPECT_EQ(units(request(4)), (std::vector<Bytes>{request(2), request(3), request(4)}));
  EXPECT_EQ(units(request(8, 5)), (std::vector<Bytes>{request(7, 5), request(8, 5)}));
  const size_t size = request(5).size();
  EXPECT_EQ(units(request(5), 2 * size + 2), (std::vector<Bytes>{request(4), request(5)}));
  EXPECT_EQ(units(request(6), 2 * size + 1), (std::vector<Bytes>{request(6)}));
  packetizer.clear();
  EXPECT_EQ(units(request(9)), (std::vector<Bytes>{request(9)}));
  const std::vector<Sent> packets = packetize(packetizer, request(10, 0, 2000), 1388);
  ASSERT_EQ(packets.size(), 4u);
  for (size_t i = 0; i < 4; i++) EXPECT_EQ(packets[i].last, i == 3);
}

TEST(Packetizer, UnitsOfFutureVersionsAreSentUnchanged) {
  Bytes unit = answer(1, 60, 60, 0);
  unit[4] = 9;
  EXPECT_EQ(packetize(UnitKind::kAnswer, unit, 100000).size(), 1u);
  EXPECT_GT(packetize(UnitKind::kAnswer, unit, 1388).size(), 3u);
  unit[4] = wire::kVersion;
  unit[5] = 77;
  EXPECT_EQ(packetize(UnitKind::kAnswer, unit, 100000).size(), 1u);
}

TEST(Packetizer, RefusesInvalidUnits) {
  const auto reason_of = [](UnitKind kind, const Bytes& unit) {
    std::string reason;
    Packetizer packetizer(kind);
    EXPECT_FALSE(packetizer.packetize(
        unit, 1388, [](const Payload&) { ADD_FAILURE(); }, &reason));
    EXPECT_EQ(packetizer.stats().units, 0u);
    return reason;
  };
  const Bytes good = answer(1, 20, 20, 0);
  const std::string no_unit = "exactly one unit";
  EXPECT_MENTIONS(reason_of(UnitKind::kAnswer, {}), no_unit);
  EXPECT_MENTIONS(reason_of(UnitKind::kAnswer, Bytes(100, 'x')), no_unit);
  EXPECT_MENTIONS(reason_of(UnitKind::kAnswer, request(1)), no_unit);
  EXPECT_MENTIONS(reason_of(UnitKind::kRequest, good), no_unit);
  EXPECT_MENTIONS(reason_of(UnitKind::kAnswer, {good.begin(), good.end() - 1}), no_unit);
  EXPECT_MENTIONS(reason_of(UnitKind::kAnswer, wire::with(good, 48, 2, 0)), "view_width", "1 to 16384 pixels", "0");
  EXPECT_EQ(reason_of(UnitKind::kRequest, wire::with(request(1), 36, 2, 0)).empty(), false);
}

// Overhead of a fragment on a link beyond its entropy-coded bytes.

constexpr size_t kMtu = 1400, kRtpHeader = 12, kIpAndUdpHeaders = 28;
constexpr int kViewSize = 16 * 31 / 2;

size_t entropy_coded_bytes(const Bytes& unit) {
  size_t bytes = 0;
  for (const wire::AnswerView answer = wire::parsed(unit); const wire::FragmentView& f : answer.fragments) {
    const wire::Scans scans = wire::split_scans(f.payload, f.has_missing).value();
    bytes += scans.pixels.size() + scans.lost.size();
  }
  return bytes;
}

TEST(Overhead, SmallFragmentsCostAtMost60Bytes) {
  // 32 x 32 cameras that fill the view: fragments of about 16 x 16 pixels.
  std::vector<Fragment> fragments = weighted_fragments(PixelFamily::kI420, 32, kViewSize, kViewSize, 64);
  std::erase_if(fragments, [](const Fragment& f) { return f.rect.width() > 18 || f.rect.height() > 18; });
  ASSERT_GT(fragments.size(), 40u);
  const auto count = static_cast<double>(fragments.size());
  const wire::AnswerHeader header = wire::header_of_view(PixelFamily::kI420, kViewSize, kViewSize);
  for (const int quality : {50, 75, 90}) {
    const Bytes unit = to_bytes(wire::encode_fragments(header, fragments, quality));
    size_t sent = 0;
    const std::vector<Sent> packets = packetize(wire::UnitKind::kAnswer, unit, kMtu - kRtpHeader);
    for (const Sent& packet : packets) sent += packet.payload.size() + kRtpHeader + kIpAndUdpHeaders;
    const auto coded = static_cast<double>(entropy_coded_bytes(unit));
    const double overhead = (static_cast<double>(sent) - coded) / count;
    std::printf("quality %d: %.0f fragments of %.1f bytes in %zu packets, %.1f bytes beyond each\n", quality, count,
                coded / count, packets.size(), overhead);
    EXPECT_LE(overhead, 60);
  }
}

TEST(Pacer, SpreadsABurst) {
  Pacer pacer;
  EXPECT_EQ(pacer.next(1000), 1000u);
  pacer.sent(1000, 1000, 8'000'000);
  EXPECT_EQ(pacer.next(1000), 1'001'000u - Pacer::kMaxLead);
  pacer.sent(1'001'000, 500, 8'000'000);
  EXPECT_EQ(pacer.next(1'002'000), 1'501'000u - Pacer::kMaxLead);
}

TEST(Pacer, LimitsTheLead) {
  Pacer pacer;
  uint64_t now = 5'000'000;
  for (uint64_t i = 0; i < 1000; i++) {
    now = pacer.next(now);
    pacer.sent(now, 1000, 80'000'000);
    EXPECT_GE(now + Pacer::kMaxLead, 5'000'000 + i * 100'000);
    EXPECT_LE(now, 5'000'000 + i * 100'000);
  }
}

TEST(Pacer, DoesNotMakeUpForIdleTime) {
  Pacer pacer;
  pacer.sent(0, 1000, 8'000'000);
  EXPECT_EQ(pacer.next(1'000'000'000), 1'000'000'000u);
  pacer.sent(1'000'000'000, 1000, 8'000'000);
  EXPECT_EQ(pacer.next(1'000'000'000), 1'001'000'000u - Pacer::kMaxLead);
  pacer.clear();
  EXPECT_EQ(pacer.next(5), 5u);
}

TEST(Pacer, DoesNotWaitAfterTheClockIsSetBack) {
  Pacer pacer;
  pacer.sent(pacer.next(3'600'000'000'000), 1000, 8'000'000);
  EXPECT_EQ(pacer.next(1'000'000'000), 1'000'000'000u);
  pacer.sent(1'000'000'000, 1000, 8'000'000);
  EXPECT_EQ(pacer.next(1'000'000'000), 1'001'000'000u - Pacer::kMaxLead);
}

}  // namespace
}  // namespace lf::rtp
