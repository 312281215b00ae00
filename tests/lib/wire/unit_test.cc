// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/unit.h"

#include <gtest/gtest.h>

#include "lib/wire/wire_test.h"
#include "wire/limits.h"

namespace lf::wire {
namespace {

const std::vector<uint8_t> kRequest = from_hex("8f4c46510101000100000040");
const std::vector<uint8_t> kAnswer = from_hex("8f4c46410101000040000000");

TEST(Unit, PeekReadsBothKinds) {
  const std::optional<UnitHeader> request = peek_unit(kRequest);
  ASSERT_TRUE(request.has_value());
  EXPECT_EQ(request->kind, UnitKind::kRequest);
  EXPECT_EQ(request->size, 64u);
  EXPECT_EQ(request->version, 1);
  EXPECT_EQ(request->type, 1);
  EXPECT_EQ(request->flags, 1);
  const std::optional<UnitHeader> answer = peek_unit(kAnswer);
  ASSERT_TRUE(answer.has_value());
  EXPECT_EQ(answer->kind, UnitKind::kAnswer);
  EXPECT_EQ(answer->size, kMaxAnswerBytes);
}

TEST(Unit, PeekPassesVersionsAndTypesToCome) {
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

TEST(Unit, HeaderIsWrittenAsRead) {
  Writer out(kUnitHeaderBytes);
  put_unit_header(out, UnitKind::kRequest, 1, 1, 64);
  EXPECT_EQ(out.take(), kRequest);
}

TEST(Unit, DistanceToMagic) {
  const struct {
    const char* hex;
    size_t more, last;  // to pass over if more bytes come, if none do
  } rows[] = {
      {"00", 1, 1},         {"8f", 1, 1},           {"8f4c", 2, 2},   {"00008f", 2, 3},       {"00008f4c", 2, 4},
      {"00008f4c46", 2, 2}, {"8f4c468f4c46", 3, 3}, {"8f8f4c", 1, 3}, {"8f4c8f8f4c46", 3, 3}, {"000000000000", 6, 6},
  };
  for (const auto& row : rows) {
    EXPECT_EQ(distance_to_magic(from_hex(row.hex), true), row.more) << row.hex;
    EXPECT_EQ(distance_to_magic(from_hex(row.hex), false), row.last) << row.hex;
  }
}

}  // namespace
}  // namespace lf::wire
