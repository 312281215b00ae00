// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/text.h"
#include "lib/wire/wire_test.h"
#include "wire/unit.h"

namespace lf::wire {
namespace {

TEST(Bytes, AreBigEndian) {
  Writer out(23);
  out.put(uint8_t{0x01});
  out.put(uint16_t{0x0203});
  out.put(uint32_t{0x04050607});
  out.put(uint64_t{0x08090a0b0c0d0e0f});
  out.put(-2.0);
  const std::vector<uint8_t> bytes = out.take();
  std::vector<uint8_t> expected;
  for (uint8_t i = 1; i <= 15; i++) expected.push_back(i);
  expected.insert(expected.end(), {0xc0, 0, 0, 0, 0, 0, 0, 0});
  EXPECT_EQ(bytes, expected);
}

TEST(Bytes, RoundTrip) {
  const double doubles[] = {
      0., -0., 1.5, std::numeric_limits<double>::denorm_min(), -1e300, std::numeric_limits<double>::infinity()};
  Writer out(1);
  out.put(uint8_t{255});
  out.put(uint64_t{UINT64_MAX});
  for (const double d : doubles) out.put(d);
  const std::vector<uint8_t> bytes = out.take();
  Reader in(bytes);
  EXPECT_EQ(in.get<uint8_t>(), 255);
  EXPECT_EQ(in.get<uint64_t>(), UINT64_MAX);
  for (const double d : doubles) EXPECT_EQ(std::bit_cast<uint64_t>(in.get<double>()), std::bit_cast<uint64_t>(d));
  EXPECT_TRUE(in.ok());
  EXPECT_EQ(in.left(), 0u);
}

TEST(Bytes, ReadsBeyondTheEndFail) {
  const std::vector<uint8_t> bytes = {1, 2, 3};
  Reader in(bytes);
  EXPECT_EQ(in.get<uint32_t>(), 0u);
  EXPECT_FALSE(in.ok());
  EXPECT_EQ(in.get<uint8_t>(), 0);
  EXPECT_EQ(in.left(), 0u);
  EXPECT_FALSE(in.ok());
  Reader blocks(bytes);
  EXPECT_EQ(blocks.get_bytes(3).size(), 3u);
  EXPECT_TRUE(blocks.get_bytes(SIZE_MAX).empty());
  EXPECT_FALSE(blocks.ok());
}

const std::vector<uint8_t> kRequest = from_hex("8f4c46510101000100000040");
const std::vector<uint8_t> kAnswer = from_hex("8f4c46410101000040000000");

TEST(Unit, PeekReadsBothKinds) {
  const UnitHeader request = peek_unit(kRequest).value(), answer = peek_unit(kAnswer).value();
  EXPECT_EQ(request.kind, UnitKind::kRequest);
  EXPECT_EQ(request.size, 64u);
  EXPECT_EQ(request.version, 1);
  EXPECT_EQ(request.type, 1);
  EXPECT_EQ(request.flags, 1);
  EXPECT_EQ(answer.kind, UnitKind::kAnswer);
  EXPECT_EQ(answer.size, kMaxAnswerBytes);
}

TEST(Unit, PeekAcceptsFutureVersionsAndTypes) {
  EXPECT_TRUE(peek_unit(with(kRequest, 4, 1, 2)).has_value());
  EXPECT_TRUE(peek_unit(with(kRequest, 5, 1, 4)).has_value());
  EXPECT_TRUE(peek_unit(with(kRequest, 6, 2, 0xffff)).has_value());
}

TEST(Unit, PeekRefusesEverythingElse) {
  for (size_t n = 0; n < kUnitHeaderBytes; n++) EXPECT_FALSE(peek_unit(std::span(kRequest).first(n)).has_value()) << n;
  for (int byte = 0; byte < 4; byte++) EXPECT_FALSE(peek_unit(with(kRequest, byte, 1, 0)).has_value()) << byte;
  EXPECT_FALSE(peek_unit(with(kRequest, 4, 1, 0)).has_value());
  EXPECT_FALSE(peek_unit(with(kRequest, 5, 1, 0)).has_value());
  EXPECT_FALSE(peek_unit(with(kRequest, 8, 4, 11)).has_value());
  EXPECT_FALSE(peek_unit(with(kRequest, 8, 4, kMaxRequestBytes + 1)).has_value());
  EXPECT_FALSE(peek_unit(with(kAnswer, 8, 4, kMaxAnswerBytes + 1)).has_value());
  EXPECT_FALSE(peek_unit(with(kAnswer, 8, 4, 0xffffffff)).has_value());
}

TEST(Unit, HeaderRoundTrips) {
  Writer out(kUnitHeaderBytes);
  put_unit_header(out, UnitKind::kRequest, 1, 1, 64);
  EXPECT_EQ(out.take(), kRequest);
}

TEST(Unit, DistanceToMagic) {
  const struct {
    const char* hex;
    size_t more, last;  // bytes to skip if more bytes follow, if none follow
  } rows[] = {
      {"00", 1, 1},         {"8f", 1, 1},           {"8f4c", 2, 2},   {"00008f", 2, 3},       {"00008f4c", 2, 4},
      {"00008f4c46", 2, 2}, {"8f4c468f4c46", 3, 3}, {"8f8f4c", 1, 3}, {"8f4c8f8f4c46", 3, 3}, {"000000000000", 6, 6},
  };
  for (const auto& row : rows) {
    EXPECT_EQ(distance_to_magic(from_hex(row.hex), true), row.more) << row.hex;
    EXPECT_EQ(distance_to_magic(from_hex(row.hex), false), row.last) << row.hex;
  }
}

TEST(Deflate, RoundTrips) {
  std::mt19937 random(1);
  for (const size_t size : {0, 1, 100, 100'000}) {
    std::vector<uint8_t> bytes(size);
    for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random() % 7);
    EXPECT_EQ(inflate_exactly(deflate_all(bytes), size), bytes);
  }
  EXPECT_LT(deflate_all(std::vector<uint8_t>(19'200, 77)).size(), 120u) << "a flat map compresses well";
}

// Uncompressed blocks hold 65,535 bytes.
TEST(Deflate, StoresUncompressed) {
  std::mt19937 random(2);
  for (const size_t size : {0, 1, 65'534, 65'535, 65'536, 131'070, 200'000}) {
    std::vector<uint8_t> bytes(size);
    for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random());
    const std::vector<uint8_t> stored = store_all(bytes);
    EXPECT_EQ(inflate_exactly(stored, size), bytes);
    EXPECT_LE(stored.size(), size + 30);
  }
}

TEST(Deflate, RefusesOtherSizesAndDamage) {
  const std::vector<uint8_t> bytes(1000, 3), deflated = deflate_all(bytes);
  EXPECT_THROW(inflate_exactly(deflated, 999), Error);
  EXPECT_THROW(inflate_exactly(deflated, 1001), Error);
  std::vector<uint8_t> longer = deflated, damaged = deflated;
  longer.push_back(0);
  EXPECT_THROW(inflate_exactly(longer, 1000), Error);
  damaged[damaged.size() / 2] ^= 0x55;
  EXPECT_THROW(inflate_exactly(damaged, 1000), Error);
  EXPECT_THROW(inflate_exactly({}, 1000), Error);
  EXPECT_THROW(inflate_exactly(deflated, size_t{1} << 40), Error) << "without a huge allocation";
}

}  // namespace
}  // namespace lf::wire
