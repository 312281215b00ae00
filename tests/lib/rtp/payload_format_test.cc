// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/payload_format.h"

#include <gtest/gtest.h>

#include "lib/wire/wire_test.h"

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

TEST(PayloadFormat, ReadsWhatItWrites) {
  const std::vector<uint8_t> units = from_hex("1000aabb");
  const std::optional<ParsedPayload> parsed = parse_payload(units);
  ASSERT_TRUE(parsed.has_value());
  EXPECT_FALSE(parsed->chunk.has_value());
  EXPECT_EQ(parsed->units.data(), units.data() + 2);
  EXPECT_EQ(parsed->units.size(), 2u);

  const std::vector<uint8_t> bytes = from_hex("11001234000000100000001301ff03");
  const std::optional<ParsedPayload> chunk = parse_payload(bytes);
  ASSERT_TRUE(chunk.has_value() && chunk->chunk.has_value());
  EXPECT_EQ(chunk->chunk->unit, 0x1234);
  EXPECT_EQ(chunk->chunk->offset, 16u);
  EXPECT_EQ(chunk->chunk->size, 19u);
  EXPECT_EQ(chunk->chunk->bytes.size(), 3u);
}

TEST(PayloadFormat, RefusesWhatIsNotSound) {
  for (const char* hex : {
           "",
           "10",
           "1000",
           "11",
           "1100",
           "1001aabb",  // cut short; reserved
           "2000aabb",
           "0000aabb",
           "1200aabb",
           "ff00aabb",  // version, kind
           "110012340000001000000013",
           "1100123400000010000000",          // a chunk of nothing, half a header
           "1101123400000000000000130a",      // reserved
           "11001234000000000000000baa",      // a unit smaller than its header
           "11001234000000110000001301ff03",  // beyond the unit
           "1100123400000014000000130a",
           "11001234ffffffff000000130a",
           "11001234ffffffffffffffff0a",
       })
    EXPECT_FALSE(parse_payload(from_hex(hex)).has_value()) << hex;
  EXPECT_TRUE(parse_payload(from_hex("11001234fffffffeffffffff0a")).has_value());
}

}  // namespace
}  // namespace lf::rtp
