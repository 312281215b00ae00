// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/answer_parser.h"

#include <gtest/gtest.h>

#include <random>

#include "lib/wire/answers.h"
#include "lib/wire/wire_test.h"
#include "support/answer_codec.h"
#include "wire/answer_writer.h"
#include "wire/fragment_codec.h"
#include "wire/payload.h"

namespace lf::wire {
namespace answer_parser_test {

constexpr size_t kTable = 72, kEntry = 20, kCodec = 12, kQuality = 13, kFlags = 14, kLength = 16;

std::vector<uint8_t> to_vector(const ByteBuffer& bytes) { return {bytes.begin(), bytes.end()}; }

std::string reason_of(const std::vector<uint8_t>& bytes) {
  std::string reason;
  EXPECT_FALSE(parse_answer(bytes, &reason).has_value());
  EXPECT_FALSE(decode_answer(bytes).has_value());
  return reason;
}

// A sum in 16 bits, then three fragments in JPEG (the first with lost weight), then one raw, then pixels of a camera.
std::vector<uint8_t> mixed() {
  const AnswerHeader header = header_of_view(PixelFamily::kI420, 400, 400);
  AnswerWriter writer(header, 6);
  const SumPlanes sums = writer.add_sums({{}, header.family, {0, 0, 6, 4}, Codec::kRaw16, 0, false});
  std::fill_n(sums.plane[0], 24 + 2 * 6, int16_t{1280});
  FragmentEncoder encoder;
  for (const Fragment& f : patterned_fragments(header.family, 3, 40, 30))
    writer.add({{}, f.family, f.rect, Codec::kJpeg, 80, !f.lost.empty()},
               [&](ByteBuffer& out) { encoder.encode_payload(planes_of(f), 80, out); });
  std::ranges::fill(writer.add({{}, header.family, {2, 2, 3, 3}, Codec::kRaw, 0, true}), uint8_t{5});
  std::ranges::fill(writer.add({9, header.family, {600, 2, 602, 4}, Codec::kRaw, 0, false}), uint8_t{6});
  return to_vector(writer.finish());
}

TEST(AnswerParser, RefersToTheBytes) {
  const std::vector<uint8_t> bytes = mixed();
  std::string reason;
  const std::optional<AnswerView> view = parse_answer(bytes, &reason);
  ASSERT_TRUE(view.has_value()) << reason;
  ASSERT_EQ(view->fragments.size(), 6u);
  const uint8_t* next = bytes.data() + kTable + 6 * kEntry;
  for (const FragmentView& f : view->fragments) {
    EXPECT_EQ(f.payload.data(), next);
    next += f.payload.size();
  }
  EXPECT_EQ(next, bytes.data() + bytes.size());
  EXPECT_EQ(view->fragments[3].codec, Codec::kJpeg);
  EXPECT_FALSE(view->fragments[4].camera);
  EXPECT_EQ(view->fragments[5].camera, 9u);
  EXPECT_EQ(parse_answer_header(bytes), static_cast<const AnswerPartHeader&>(*view));
  EXPECT_EQ(peek_answer_view(bytes), view->view_id);
  EXPECT_EQ(peek_answer_view(std::span(bytes).first(16)), view->view_id) << "the rest is not looked at";
  EXPECT_FALSE(peek_answer_view(std::span(bytes).first(15)));
}

TEST(AnswerParser, RefusesEveryTruncation) {
  const std::vector<uint8_t> bytes = mixed();
  for (size_t n = 0; n < bytes.size(); n++) {
    EXPECT_FALSE(parse_answer(std::span(bytes).first(n)).has_value()) << n;
    EXPECT_FALSE(parse_answer(resized(bytes, n)).has_value()) << n;  // with a length field that agrees
  }
  EXPECT_EQ(reason_of(resized(bytes, bytes.size() + 1)), "length: 1 bytes after the last fragment's payload");
}

TEST(AnswerParser, NamesWhatIsWrongWithPayloads) {
  const std::vector<uint8_t> bytes = mixed();
  const std::optional<AnswerView> view = parse_answer(bytes);
  const size_t jpeg = view->fragments[1].payload.data() - bytes.data();
  const uint32_t jpeg_length = static_cast<uint32_t>(view->fragments[1].payload.size());
  const auto at = [](size_t entry, size_t field) { return kTable + entry * kEntry + field; };
  const struct {
    size_t offset;
    int size;
    uint64_t value;
    std::string reason;
  } rows[] = {
      // JPEG.
      {jpeg, 4, jpeg_length, "fragments[1].length: of the first scan is beyond the payload"},
      {jpeg, 4, jpeg_length - 4, "fragments[1].length: a scan of this size has at least 15 bytes, not 0"},
      {jpeg, 4, 11, "fragments[1].length: a scan of this size has at least 24 bytes, not 11"},
      {jpeg, 4, 0xffffffff, "fragments[1].length: of the first scan is beyond the payload"},
      {at(2, kQuality), 1, 0, "fragments[2].quality: must be 1 to 100 for JPEG, is 0"},
      {at(2, kQuality), 1, 101, "fragments[2].quality: must be 1 to 100 for JPEG, is 101"},
      {at(3, 10), 2, 388, "fragments[3].length: a scan of this size has at least 300 bytes"},
      // 16 bits, raw.
      {at(0, kQuality), 1, 1, "fragments[0].quality: must be 0 for raw pixels, is 1"},
      {at(0, kLength), 4, 71, "fragments[0].length: must be 72 bytes, is 71"},
      {at(0, kFlags), 2, 3, "fragments[0].length: must be 120 bytes, is 72"},
      {at(0, kCodec), 1, 0, "fragments[0].length: must be 36 bytes, is 72"},
      {at(4, kCodec), 1, 2, "fragments[4].length: must be 8 bytes, is 4"},
      {at(4, kCodec), 1, 3, "fragments[4].codec: 3 is not supported"},
      {at(4, kLength), 4, jpeg_length, "fragments[4].length: must be 4 bytes, is " + std::to_string(jpeg_length)},
      // Of a camera.
      {at(5, 0), 2, 0xffff, "fragments[5].rectangle: is not inside the view"},
      {at(5, kFlags), 2, 1, "fragments[5].flags: a sum is weighted, and pixels of a camera are not"},
      {at(5, kFlags), 2, 2, "fragments[5].flags: pixels of a camera have no lost weight"},
      {at(5, kCodec), 1, 2, "fragments[5].codec: 16 bits are for sums, not for pixels of a camera"},
  };
  for (const auto& row : rows) {
    const std::string reason = reason_of(with(bytes, row.offset, row.size, row.value));
    EXPECT_EQ(reason.substr(0, row.reason.size()), row.reason) << "offset " << row.offset << ": " << reason;
  }
}

TEST(AnswerParser, SixteenBitsBeginAtEvenOffsets) {
  AnswerWriter writer(header_of_view(PixelFamily::kRgb, 8, 8), 2);
  writer.add({{}, PixelFamily::kRgb, {0, 0, 2, 1}, Codec::kRaw, 0, false});         // 6 bytes
  writer.add_sums({{}, PixelFamily::kRgb, {0, 0, 1, 1}, Codec::kRaw16, 0, false});  // 6 bytes
  std::vector<uint8_t> bytes = to_vector(writer.finish());
  EXPECT_TRUE(parse_answer(bytes).has_value());
  bytes = resized(with(with(bytes, kTable + 8, 2, 1), kTable + kLength, 4, 3), bytes.size() - 3);  // now 3 bytes
  EXPECT_EQ(reason_of(bytes), "fragments[1].codec: 16-bit values must begin at an even offset");
}

TEST(AnswerParser, SurvivesRandomCorruption) {
  std::mt19937 random(11);
  const std::vector<uint8_t> bytes = mixed();
  FragmentDecoder decoder;
  int parsed = 0, damaged = 0;
  for (int i = 0; i < 6000; i++) {
    std::vector<uint8_t> bad = bytes;
    if (i % 8 == 0) bad = resized(std::move(bad), random() % (bad.size() + 8));
    if (bad.empty()) continue;
    corrupt(bad, kTable + 6 * kEntry, random);
    // Memory of exactly these bytes, so that a sanitizer sees what reads beyond.
    const std::optional<AnswerView> view = parse_answer(bad);
    if (!view) continue;
    parsed++;
    for (const FragmentView& f : view->fragments) {
      ASSERT_FALSE(f.rect.empty());
      ASSERT_LE(f.rect.x1, f.camera ? kMaxImageSize : view->view_width);
      ASSERT_LE(f.rect.y1, f.camera ? kMaxImageSize : view->view_height);
      if (f.codec == Codec::kRaw16) {
        ASSERT_EQ(f.payload.size(), raw_size(f));
        decoder.sums(f);
      } else {
        damaged += !decoder.decode(f);
      }
    }
  }
  EXPECT_GT(parsed, 1000);
  EXPECT_LT(parsed, 5500);
  EXPECT_GT(damaged, 50);
}

}  // namespace answer_parser_test
}  // namespace lf::wire
