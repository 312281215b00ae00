// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/consistency_codec.h"

#include "base/text.h"
#include "focus/hypothesis_levels.h"
#include "lib/wire/wire_test.h"
#include "wire/answer_codec.h"

namespace lf::wire {
namespace {

// Written from spec.md, not by the encoder: two hypotheses of 2 x 1 nodes; the first has full weight.
const char kGolden[] =
    "8f4c464101050000000000440000000700000009112233445566778800000003"
    "000200010200"
    "0000000000020001"
    "000001000200030004"
    "0180004000"
    "0005000600070008";

ConsistencyUnit golden() {
  ConsistencyUnit unit;
  unit.view_id = 7;
  unit.sequence = 9;
  unit.rig_hash = 0x1122334455667788;
  unit.node = 3;
  unit.hypotheses.resize(2);
  for (PhotoConsistency& moments : unit.hypotheses) moments.reset(2, 1);
  unit.hypotheses[0].weight = {32768, 32768};
  unit.hypotheses[0].luma = {1, 2};
  unit.hypotheses[0].square = {3, 4};
  unit.hypotheses[1].weight = {32768, 16384};
  unit.hypotheses[1].luma = {5, 6};
  unit.hypotheses[1].square = {7, 8};
  return unit;
}

std::vector<uint8_t> encoded(const ConsistencyUnit& unit) {
  const ByteBuffer bytes = encode_consistency(unit, unit.hypotheses);
  return {bytes.begin(), bytes.end()};
}

void expect_sums(const ConsistencyUnit& unit, const std::vector<PhotoConsistency>& hypotheses) {
  for (size_t t = 0; t < hypotheses.size(); t++) {
    EXPECT_EQ(unit.sums()[t].weight, hypotheses[t].weight);
    EXPECT_EQ(unit.sums()[t].luma, hypotheses[t].luma);
    EXPECT_EQ(unit.sums()[t].square, hypotheses[t].square);
  }
}

const ConsistencyShape kShape{2, 1, 2};

std::string reason_of(const std::vector<uint8_t>& bytes) {
  std::string reason;
  EXPECT_FALSE(decode_consistency(bytes, kShape, &reason).has_value());
  return reason;
}

TEST(ConsistencyCodec, GoldenBytes) {
  EXPECT_EQ(encoded(golden()), from_hex(kGolden));
  const ConsistencyUnit unit = decode_consistency(from_hex(kGolden), kShape).value();
  EXPECT_EQ(static_cast<const ConsistencyHeader&>(unit), golden());
  expect_sums(unit, golden().hypotheses);
}

// One hypothesis of 2 x 1 nodes with wide weights, and exposure gains.
TEST(ConsistencyCodec, GoldenBytesOfGains) {
  const char* const hex =
      "8f4c464101050001000000430000000700000009112233445566778800000003"
      "000200010100"
      "0000c000fffff000"
      "0000000000020001"
      "01100020000005000600070008";
  ConsistencyUnit unit = golden();
  unit.gains = GainSum{0xc000, -0x1000};
  unit.hypotheses.resize(1);
  unit.hypotheses[0].weight = {0x1000, 0x2000};
  unit.hypotheses[0].luma = {5, 6};
  unit.hypotheses[0].square = {7, 8};
  EXPECT_EQ(encoded(unit), from_hex(hex));
  const ConsistencyUnit read = decode_consistency(from_hex(hex), {2, 1, 1}).value();
  EXPECT_EQ(static_cast<const ConsistencyHeader&>(read), unit);
  EXPECT_EQ(read.sums()[0].luma, unit.hypotheses[0].luma);
}

TEST(ConsistencyCodec, OmitsInvisibleNodes) {
  ConsistencyUnit unit = golden();
  for (PhotoConsistency& moments : unit.hypotheses) moments.reset(40, 30);
  EXPECT_LT(encoded(unit).size(), 60u) << "nothing";
  unit.hypotheses[0].weight[7 * 40 + 5] = 100;
  unit.hypotheses[1].weight[9 * 40 + 8] = 32768;
  unit.hypotheses[1].square[9 * 40 + 8] = 77;
  EXPECT_EQ(encoded(unit).size(), 46 + 2 * (1 + 6 * 4 * 3));
  expect_sums(decode_consistency(encoded(unit), {40, 30, 2}).value(), unit.hypotheses);
}

// A unit of a few bytes may describe many nodes; the decoder allocates only the nodes with data.
TEST(ConsistencyCodec, InvisibleNodesAllocateNoMemory) {
  std::vector<PhotoConsistency> hypotheses(kMaxHypotheses);
  for (PhotoConsistency& moments : hypotheses) moments.reset(1024, 1024);
  for (const bool any : {false, true}) {
    if (any) hypotheses[3].weight[500 * 1024 + 70] = 5;
    const ByteBuffer bytes = encode_consistency({}, hypotheses);
    EXPECT_LT(bytes.size(), 200u);
    const ConsistencyUnit unit = decode_consistency(bytes, {1024, 1024, kMaxHypotheses}).value();
    for (const PhotoConsistency& moments : unit.hypotheses) EXPECT_EQ(moments.weight.capacity(), any ? 1u : 0u);
    EXPECT_EQ(unit.sums()[3].weight, hypotheses[3].weight);
  }
}

TEST(ConsistencyCodec, RefusesOtherShapes) {
  ConsistencyShape shape;
  EXPECT_EQ(parse_consistency_header(from_hex(kGolden), &shape).value(), golden());
  EXPECT_EQ(shape, kShape);
  for (const ConsistencyShape& other : {ConsistencyShape{2, 2, 2}, {2, 1, 3}, {0, 0, 0}, {16384, 16384, 2}})
    EXPECT_FALSE(decode_consistency(from_hex(kGolden), other).has_value());
  EXPECT_FALSE(parse_consistency_header({}).has_value());
}

TEST(ConsistencyCodec, IsDistinguishedFromFragments) {
  EXPECT_TRUE(is_consistency(from_hex(kGolden)));
  EXPECT_FALSE(parse_answer_header(from_hex(kGolden)).has_value());
  EXPECT_FALSE(is_consistency({}));
}

TEST(ConsistencyCodec, SurvivesTruncationAndFlippedBits) {
  const std::vector<uint8_t> whole = from_hex(kGolden);
  for (size_t size = 0; size < whole.size(); size++)
    EXPECT_FALSE(decode_consistency(std::span(whole).first(size), kShape).has_value()) << size;
  for (size_t bit = 0; bit < 8 * whole.size(); bit++) {
    std::vector<uint8_t> flipped = whole;
    flipped[bit / 8] ^= static_cast<uint8_t>(1 << bit % 8);
    decode_consistency(flipped, kShape);
  }
  std::vector<uint8_t> longer = whole;
  longer.push_back(0);
  EXPECT_FALSE(decode_consistency(longer, kShape).has_value());
}

TEST(ConsistencyCodec, ErrorsNameTheProblem) {
  const auto with = [](size_t at, uint8_t value) {
    std::vector<uint8_t> bytes = from_hex(kGolden);
    bytes[at] = value;
    return reason_of(bytes);
  };
  EXPECT_THAT(with(36, 0), testing::StartsWith("depth hypotheses: "));
  EXPECT_THAT(with(36, 200), testing::StartsWith("depth hypotheses: "));
  EXPECT_THAT(with(37, 1), testing::StartsWith("reserved: "));
  EXPECT_THAT(with(33, 0), testing::StartsWith("photo-consistency: "));
  EXPECT_THAT(with(46, 2), testing::StartsWith("depth hypotheses: "));
  EXPECT_THROW(encode_consistency({}, {}), Error);
  std::vector<PhotoConsistency> many(kMaxHypotheses + 1);
  EXPECT_THROW(encode_consistency({}, many), Error);
  std::vector<PhotoConsistency> unlike(2);
  unlike[0].reset(2, 2);
  unlike[1].reset(2, 1);
  EXPECT_THROW(encode_consistency({}, unlike), Error);
}

std::vector<PhotoConsistency> seen_by(int cameras, size_t hypotheses, uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<PhotoConsistency> sums(hypotheses);
  for (PhotoConsistency& sum : sums) sum.reset(40, 30);
  for (int camera = 0; camera < cameras; camera++)
    for (int y = 3; y < 25; y++)
      for (int x = 5; x < 35; x++) {
        const auto weight = static_cast<uint16_t>(std::min({x - 4, 36 - x, 16}) * 2048 / (camera + 1) % 32769);
        for (size_t t = 0; t < hypotheses; t++) {
          if (random() % 8 == 0) continue;
          const int value =
              camera + static_cast<int>(100 + 80 * std::sin(x * 0.3 + y * 0.2 + 0.1 * static_cast<double>(t)));
          const uint16_t luma = PhotoConsistency::luma_of(weight, value);
          const size_t node = static_cast<size_t>(y) * 40 + x;
          const auto add = [node](auto& plane, uint16_t more) {
            plane[node] = static_cast<uint16_t>(plane[node] + more);
          };
          add(sums[t].weight, weight);
          add(sums[t].luma, luma);
          add(sums[t].square, PhotoConsistency::square_of(luma, value));
        }
      }
  return sums;
}

TEST(ConsistencyCodec, SumsOfOneCameraAreCompressedWithoutLoss) {
  const ConsistencyHeader header{7, 9, 0x1122334455667788, 3, {}};
  for (const size_t hypotheses : {1, 4, 16})
    for (const int cameras : {1, 2}) {
      const std::vector<PhotoConsistency> sums = seen_by(cameras, hypotheses, 3);
      const ByteBuffer plain = encode_consistency(header, sums), small = encode_consistency(header, sums, true);
      if (cameras == 1)
        EXPECT_LT(2 * small.size(), plain.size());
      else
        EXPECT_EQ(small, plain) << "no compact form";
      std::string reason;
      const std::optional<ConsistencyUnit> unit = decode_consistency(small, {40, 30, hypotheses}, &reason);
      ASSERT_TRUE(unit) << reason;
      EXPECT_EQ(static_cast<const ConsistencyHeader&>(*unit), header);
      expect_sums(*unit, sums);
    }
}

// Every weight and luma that a camera can have decodes to a distinct value or to an equal sum.
TEST(ConsistencyCodec, OneCameraMayHaveAnyWeightAndLuma) {
  for (int first = 0; first <= PhotoConsistency::kWeightOne; first += 256) {
    std::vector<PhotoConsistency> sum(1);
    sum[0].reset(256, 257);
    for (int w = 0; w <= 256 && first + w <= PhotoConsistency::kWeightOne; w++)
      for (int value = 0; value < 256; value++) {
        const size_t node = static_cast<size_t>(w) * 256 + value;
        sum[0].weight[node] = static_cast<uint16_t>(first + w);
        sum[0].luma[node] = PhotoConsistency::luma_of(sum[0].weight[node], value);
        sum[0].square[node] = PhotoConsistency::square_of(sum[0].luma[node], value);
      }
    const ByteBuffer bytes = encode_consistency({}, sum, true);
    const ConsistencyUnit unit = decode_consistency(bytes, {256, 257, 1}).value();
    ASSERT_EQ(unit.sums()[0].luma, sum[0].luma) << first;
    ASSERT_EQ(unit.sums()[0].square, sum[0].square) << first;
    ASSERT_LT(bytes.size(), 256u * 257 * 4) << first;
  }
}

TEST(ConsistencyCodec, CompressedSumsSurviveDamage) {
  const ByteBuffer whole = encode_consistency({}, seen_by(1, 2, 5), true);
  const ConsistencyShape shape{40, 30, 2};
  const std::vector<uint8_t> bytes(whole.begin(), whole.end());
  for (size_t size = 0; size < bytes.size(); size++) {
    EXPECT_FALSE(decode_consistency(std::span(bytes).first(size), shape)) << size;
    EXPECT_FALSE(decode_consistency(resized(bytes, size), shape)) << size;
  }
  for (size_t bit = 0; bit < 8 * bytes.size(); bit++) {
    std::vector<uint8_t> flipped = bytes;
    flipped[bit / 8] ^= static_cast<uint8_t>(1 << bit % 8);
    std::string reason;
    EXPECT_TRUE(decode_consistency(flipped, shape, &reason) || !reason.empty());
  }
  std::vector<uint8_t> both = bytes;
  both[7] = 3;
  std::string reason;
  EXPECT_FALSE(decode_consistency(both, shape, &reason));
  EXPECT_MENTIONS(reason, "flags", "gains", "camera");
}

}  // namespace
}  // namespace lf::wire
