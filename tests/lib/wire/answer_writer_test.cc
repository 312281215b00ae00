// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/answer_writer.h"

#include <gtest/gtest.h>

#include "lib/wire/answers.h"
#include "support/expect_error.h"
#include "wire/answer_parser.h"
#include "wire/payload.h"

namespace lf::wire {
namespace {

constexpr auto kRgb = PixelFamily::kRgb;

void append_bytes(ByteBuffer& out, int n) { out.insert(out.end(), static_cast<size_t>(n), uint8_t{0}); }

TEST(AnswerWriter, PartsOfAnAnswer) {
  const AnswerHeader header = header_of_view(PixelFamily::kRgb, 8, 8);
  AnswerWriter writer(header, 2);
  std::ranges::fill(writer.add({1, header.family, {0, 0, 2, 2}}), uint8_t{3});
  writer.set_part(4, 9);
  const ByteBuffer bytes = writer.finish();
  const std::optional<AnswerView> view = parse_answer(bytes);
  ASSERT_TRUE(view.has_value());
  EXPECT_EQ(view->part, (AnswerPart{4, 1, 9}));
  EXPECT_EQ(parse_answer_header(bytes)->part, view->part);
  AnswerWriter beyond(header, 1);
  beyond.add({1, header.family, {0, 0, 2, 2}});
  beyond.set_part(9, 9);
  EXPECT_THROW(beyond.finish(), Error);
}

TEST(AnswerWriter, PayloadsAreWrittenInPlace) {
  const AnswerHeader header = header_of_view(kRgb, 8, 8);
  AnswerWriter writer(header, 3);
  const FragmentHeader sums{{}, kRgb, {1, 1, 4, 4}, Codec::kRaw16, 0, true};
  const SumPlanes planes = writer.add_sums(sums);
  for (int c = 0; c < 3; c++)
    for (int i = 0; i < 9; i++) planes.plane[c][i] = static_cast<int16_t>(100 * c + i - 3);
  for (int i = 0; i < 9; i++) planes.lost[i] = static_cast<uint16_t>(32768 - i);
  const FragmentHeader raw{5, kRgb, {0, 0, 2, 1}, Codec::kRaw, 0, false};
  const std::span<uint8_t> pixels = writer.add(raw);
  ASSERT_EQ(pixels.size(), 6u);
  std::ranges::fill(pixels, uint8_t{77});
  const FragmentHeader jpeg{6, kRgb, {0, 0, 2, 1}, Codec::kJpeg, 80, false};
  writer.add(jpeg, [](ByteBuffer& out) { append_bytes(out, 5); });
  EXPECT_EQ(writer.fragments(), 3u);
  const ByteBuffer bytes = writer.finish();

  std::string reason;
  const std::optional<AnswerView> view = parse_answer(bytes, &reason);
  ASSERT_TRUE(view.has_value()) << reason;
  AnswerHeader expected = header;
  EXPECT_EQ(static_cast<const AnswerHeader&>(*view), expected);
  ASSERT_EQ(view->fragments.size(), 3u);
  EXPECT_EQ(static_cast<const FragmentHeader&>(view->fragments[0]), sums);
  EXPECT_EQ(static_cast<const FragmentHeader&>(view->fragments[1]), raw);
  EXPECT_EQ(static_cast<const FragmentHeader&>(view->fragments[2]), jpeg);
  const uint8_t* const first = view->fragments[0].payload.data();
  EXPECT_EQ(first - bytes.data(), 132);
  EXPECT_EQ(first[0], 0xfd);  // -3, little-endian
  EXPECT_EQ(first[1], 0xff);
  EXPECT_EQ(raw16_planes(view->fragments[0], first).plane[2][8], 205);
  EXPECT_EQ(raw16_planes(view->fragments[0], first).lost[1], 32767);
  EXPECT_EQ(view->fragments[1].payload[5], 77);
  EXPECT_EQ(view->fragments[2].payload.size(), 5u);
}

TEST(AnswerWriter, LostWeightThatIsNothingIsTakenBack) {
  for (int which = 0; which < 8; which++) {  // bit i: fragment i has none
    AnswerWriter writer(header_of_view(kRgb, 8, 8), 3), expected(header_of_view(kRgb, 8, 8), 3);
    for (int i = 0; i < 3; i++) {
      const bool none = which >> i & 1;
      const FragmentHeader with{{}, kRgb, {0, 2 * i, 3 + i, 2 * i + 2}, Codec::kRaw16, 0, true};
      FragmentHeader without = with;
      without.has_lost = !none;
      const std::span<uint8_t> bytes = writer.add(with), wanted = expected.add(without);
      for (size_t k = 0; k < bytes.size(); k++) bytes[k] = static_cast<uint8_t>(50 * i + k);
      std::copy_n(bytes.begin(), wanted.size(), wanted.begin());
    }
    writer.drop_lost([&](size_t i) { return which >> i & 1; });
    EXPECT_EQ(writer.fragments(), 3u);
    EXPECT_EQ(writer.finish(), expected.finish()) << which;
  }
  AnswerWriter raw(header_of_view(kRgb, 8, 8), 1);
  raw.add({{}, kRgb, {0, 0, 2, 2}, Codec::kRaw, 0, true});
  EXPECT_THROW(raw.drop_lost([](size_t) { return true; }), Error);
}

TEST(AnswerWriter, FewerFragmentsThanRoomCloseUp) {
  for (int given = 0; given <= 3; given++) {
    AnswerWriter writer(header_of_view(kRgb, 8, 8), 3), exact(header_of_view(kRgb, 8, 8), given);
    for (AnswerWriter* w : {&writer, &exact})
      for (int i = 0; i < given; i++)
        std::ranges::fill(w->add({static_cast<CameraIndex>(i), kRgb, {0, 0, 2, 2}, Codec::kRaw, 0, false}),
                          static_cast<uint8_t>(i));
    EXPECT_EQ(writer.finish(), exact.finish());
  }
}

TEST(AnswerWriter, UsesTheMemoryItIsGiven) {
  ByteBuffer old(1000, 0xee);
  const uint8_t* const where = old.data();
  AnswerWriter writer(header_of_view(kRgb, 8, 8), 1, std::move(old));
  writer.add({0, kRgb, {0, 0, 8, 8}, Codec::kRaw, 0, false});
  const ByteBuffer bytes = writer.finish();
  EXPECT_EQ(bytes.data(), where);
  EXPECT_EQ(bytes.size(), 92u + 192);
}

TEST(AnswerWriter, RefusesWhatCannotBeRead) {
  const FragmentHeader good{{}, kRgb, {0, 0, 3, 3}, Codec::kRaw, 0, false};
  const auto changed = [&](auto change) {
    FragmentHeader f = good;
    change(f);
    return f;
  };
  const auto adds = [](const FragmentHeader& f) {
    AnswerWriter writer(header_of_view(kRgb, 8, 8), 2);
    writer.add(f);
  };
  EXPECT_ERROR(AnswerWriter(header_of_view(kRgb, 0, 8), 0), "view_width: must be 1 to 16384 pixels, is 0");
  EXPECT_ERROR(adds(changed([](FragmentHeader& f) { f.rect.x1 = 9; })),
               "fragments[0].rectangle: is not inside the view");
  EXPECT_ERROR(adds(changed([](FragmentHeader& f) { f.family = PixelFamily::kI420; })),
               "fragments[0].family: differs from the answer's");
  EXPECT_ERROR(adds(changed([](FragmentHeader& f) { f.quality = 1; })),
               "fragments[0].quality: must be 0 for raw pixels, is 1");
  EXPECT_ERROR(adds(changed([](FragmentHeader& f) { f.codec = Codec::kJpeg; })),
               "fragments[0].quality: must be 1 to 100 for JPEG, is 0");

  AnswerWriter writer(header_of_view(kRgb, 8, 8), 2);
  EXPECT_ERROR(writer.add(good, [](ByteBuffer& out) { append_bytes(out, 26); }),
               "fragments[0].length: 26 bytes are no payload of this fragment");
  AnswerWriter odd(header_of_view(kRgb, 8, 8), 2);
  odd.add(good);  // 27 bytes
  EXPECT_ERROR(odd.add_sums({{}, kRgb, {0, 0, 3, 3}, Codec::kRaw16, 0, false}),
               "fragments[1].codec: 16-bit values must begin at an even offset");
  odd.add(good);
  EXPECT_ERROR(odd.add(good), "fragments: more than the 2 there is room for");
}

}  // namespace
}  // namespace lf::wire
