// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/part_plan.h"

#include <gtest/gtest.h>

#include "lib/rtp/rtp_test.h"
#include "wire/answer_layout.h"

namespace lf::rtp {
namespace {

TEST(PartPlan, AreFullAndHaveTheSizesPlanned) {
  const Bytes unit = answer(60, 40, 30, 75);
  const wire::AnswerView view = wire::parse_answer(unit).value();
  const std::optional<PartPlan> plan = plan_parts(view, 1386);
  ASSERT_TRUE(plan.has_value());
  EXPECT_EQ(plan->total, 60u);
  size_t largest_piece = 0;
  for (const Piece& piece : plan->pieces) largest_piece = std::max(largest_piece, piece.bytes + 20);
  for (const Part& part : plan->parts) {
    EXPECT_EQ(write_part(view, *plan, part, {}).size(), part.bytes);
    EXPECT_TRUE(part.count == 1 || part.bytes <= 1386u);
    EXPECT_TRUE(&part == &plan->parts.back() || part.bytes > 1386 - largest_piece);
  }
}

TEST(PartPlan, SixteenBitValuesBeginAtEvenOffsets) {
  // Two JPEG payloads of odd lengths with a sum behind them: in another part than one of them it would be misplaced.
  const wire::AnswerHeader header = wire::header_of_view(PixelFamily::kRgb, 400, 400);
  wire::AnswerWriter writer(header, 3);
  for (int i = 0; i < 2; i++)
    writer.add({{}, header.family, {0, 0, 16, 16}, wire::Codec::kJpeg, 50, false},
               [](ByteBuffer& out) { append(out, Bytes(501, 0x55)); });
  writer.add({{}, header.family, {0, 0, 4, 4}, wire::Codec::kRaw16, 0, false});
  const Bytes unit = to_bytes(writer.finish());
  const wire::AnswerView view = wire::parse_answer(unit).value();
  const std::optional<PartPlan> plan = plan_parts(view, 800);
  ASSERT_TRUE(plan.has_value());
  EXPECT_EQ(plan->parts.size(), 3u);
  for (const Part& part : plan->parts) EXPECT_TRUE(wire::parse_answer(write_part(view, *plan, part, {})).has_value());
}

TEST(PartPlan, NothingToGive) {
  const Bytes unit = answer(0, 1, 1, 0);
  const wire::AnswerView view = wire::parse_answer(unit).value();
  const std::optional<PartPlan> plan = plan_parts(view, 500);
  ASSERT_EQ(plan->parts.size(), 1u);
  EXPECT_EQ(to_bytes(write_part(view, *plan, plan->parts[0], {})), unit);
}

}  // namespace
}  // namespace lf::rtp
