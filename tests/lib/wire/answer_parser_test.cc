// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/answer_parser.h"

#include <gtest/gtest.h>

#include <random>

#include "lib/wire/answers.h"
#include "lib/wire/wire_test.h"
#include "wire/answer_codec.h"
#include "wire/answer_writer.h"
#include "wire/fragment_codec.h"
#include "wire/payload.h"

namespace lf::wire {
namespace {

constexpr size_t kTable = 72, kEntry = 20, kCodec = 12, kQuality = 13, kFlags = 14, kLength = 16;

std::vector<uint8_t> to_vector(const ByteBuffer& bytes) { return {bytes.begin(), bytes.end()}; }

std::string reason_of(const std::vector<uint8_t>& bytes) {
  std::string reason;
  EXPECT_FALSE(parse_answer(bytes, &reason).has_value());
  EXPECT_FALSE(decode_answer(bytes).has_value());
  return reason;
}

// A sum in 16 bits, then an atlas of three (the first with lost weight), then one in JPEG, then one raw.
std::vector<uint8_t> mixed() {
  const AnswerHeader header = header_of_view(PixelFamily::kI420, 400, 400);
  AnswerWriter writer(header, 6);
  const SumPlanes sums = writer.add_sums({Fragment::kSum, header.family, {0, 0, 6, 4}, Codec::kRaw16, 0, false});
  std::fill_n(sums.plane[0], 24 + 2 * 6, int16_t{1280});
  const std::vector<Fragment> fragments = patterned_fragments(header.family, 4, 40, 30);
  const std::vector<FragmentPlanes> planes = jpeg::planes_of_all(fragments);
  jpeg::FragmentEncoder encoder;
  const auto entry = [&](int i, Codec codec, int quality) {
    return FragmentHeader{
        fragments[i].camera,       header.family, fragments[i].rect, codec, static_cast<uint8_t>(quality),
        !fragments[i].lost.empty()};
  };
  writer.add(entry(0, Codec::kJpegAtlas, 80), [&](ByteBuffer& out) {
    ByteBuffer pixels;
    encoder.encode_pixels(std::span(planes).first(3), 80, pixels);
    const uint8_t length[4] = {0, 0, static_cast<uint8_t>(pixels.size() >> 8), static_cast<uint8_t>(pixels.size())};
    append(out, length);
    append(out, pixels);
    encoder.encode_lost(std::span(planes).first(3), 90, out);
  });
  writer.add_member(entry(1, Codec::kJpegAtlas, 80));
  writer.add_member(entry(2, Codec::kJpegAtlas, 80));
  FragmentHeader alone = entry(3, Codec::kJpeg, 70);
  alone.has_lost = false;
  writer.add(alone, [&](ByteBuffer& out) { encoder.encode_pixels(std::span(planes).subspan(3, 1), 70, out); });
  std::ranges::fill(writer.add({9, header.family, {2, 2, 3, 3}, Codec::kRaw, 0, true}), uint8_t{5});
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
    if (f.payload.empty()) continue;
    EXPECT_EQ(f.payload.data(), next);
    next += f.payload.size();
  }
  EXPECT_EQ(next, bytes.data() + bytes.size());
  EXPECT_TRUE(view->fragments[2].payload.empty());
  EXPECT_EQ(view->fragments[3].codec, Codec::kJpegAtlas);
  EXPECT_EQ(parse_answer_header(bytes), static_cast<const AnswerHead&>(*view));
  EXPECT_EQ(peek_answer_view(bytes), view->view_id);
  EXPECT_EQ(peek_answer_view(std::span(bytes).first(16)), view->view_id) << "the rest is not looked at";
  EXPECT_FALSE(peek_answer_view(std::span(bytes).first(15)));
  ASSERT_TRUE(decode_answer(bytes).has_value());
  EXPECT_EQ(decode_answer(bytes)->fragments.size(), 6u);
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
  const size_t atlas = view->fragments[1].payload.data() - bytes.data();
  const uint32_t atlas_length = static_cast<uint32_t>(view->fragments[1].payload.size());
  const uint32_t jpeg_length = static_cast<uint32_t>(view->fragments[4].payload.size());
  const auto at = [](size_t entry, size_t field) { return kTable + entry * kEntry + field; };
  const struct {
    size_t offset;
    int size;
    uint64_t value;
    std::string reason;
  } rows[] = {
      // Atlases.
      {at(1, kCodec), 1, 1, "fragments[2].length: a JPEG of 0 bytes"},  // members without a head
      {at(1, kLength), 4, 0, "length: " + std::to_string(atlas_length) + " bytes after the last"},
      {at(2, kQuality), 1, 81, "fragments[1].quality: differs in an atlas"},
      {at(2, kCodec), 1, 0, "fragments[2].quality: must be 0 for raw pixels, is 80"},
      {at(2, kCodec), 2, 0, "fragments[2].length: must be 1800 bytes, is 0"},
      {at(2, kCodec), 1, 1, "fragments[2].length: a JPEG of 0 bytes"},
      {at(3, kCodec), 1, 1, "fragments[3].length: a JPEG of 0 bytes"},
      {atlas, 4, atlas_length, "fragments[1].length: of the first scan is beyond the payload"},
      {atlas, 4, atlas_length - 4, "fragments[1].length: a scan of this size has at least 15 bytes, not 0"},
      {atlas, 4, 11, "fragments[1].length: a scan of this size has at least 72 bytes, not 11"},
      {atlas, 4, 0xffffffff, "fragments[1].length: of the first scan is beyond the payload"},
      // One in JPEG.
      {at(4, kQuality), 1, 0, "fragments[4].quality: must be 1 to 100 for JPEG, is 0"},
      {at(4, kQuality), 1, 101, "fragments[4].quality: must be 1 to 100 for JPEG, is 101"},
      {at(4, kLength), 4, 0, "length: " + std::to_string(jpeg_length) + " bytes after the last"},
      {at(4, 10), 2, 388, "fragments[4].length: a scan of this size has at least 300 bytes"},
      // 16 bits, raw.
      {at(0, kQuality), 1, 1, "fragments[0].quality: must be 0 for raw pixels, is 1"},
      {at(0, kLength), 4, 71, "fragments[0].length: must be 72 bytes, is 71"},
      {at(0, kFlags), 2, 3, "fragments[0].length: must be 120 bytes, is 72"},
      {at(0, kCodec), 1, 0, "fragments[0].length: must be 36 bytes, is 72"},
      {at(5, kCodec), 1, 2, "fragments[5].length: must be 8 bytes, is 4"},
      {at(5, kCodec), 1, 4, "fragments[5].codec: 4 is not supported"},
      {at(5, kLength), 4, jpeg_length, "fragments[5].length: must be 4 bytes, is " + std::to_string(jpeg_length)},
  };
  for (const auto& row : rows) {
    const std::string reason = reason_of(with(bytes, row.offset, row.size, row.value));
    EXPECT_EQ(reason.substr(0, row.reason.size()), row.reason) << "offset " << row.offset << ": " << reason;
  }
}

TEST(AnswerParser, SixteenBitsBeginAtEvenOffsets) {
  AnswerWriter writer(header_of_view(PixelFamily::kRgb, 8, 8), 2);
  writer.add({1, PixelFamily::kRgb, {0, 0, 2, 1}, Codec::kRaw, 0, false});         // 6 bytes
  writer.add_sums({2, PixelFamily::kRgb, {0, 0, 1, 1}, Codec::kRaw16, 0, false});  // 6 bytes
  std::vector<uint8_t> bytes = to_vector(writer.finish());
  EXPECT_TRUE(parse_answer(bytes).has_value());
  bytes = resized(with(with(bytes, kTable + 8, 2, 1), kTable + kLength, 4, 3), bytes.size() - 3);  // now 3 bytes
  EXPECT_EQ(reason_of(bytes), "fragments[1].codec: 16-bit values must begin at an even offset");
}

TEST(AnswerParser, AtlasesHaveLimits) {
  const auto atlas_of = [](int members, int height) {
    AnswerWriter writer(header_of_view(PixelFamily::kRgb, 16, 16384), static_cast<size_t>(members));
    const FragmentHeader f{0, PixelFamily::kRgb, {0, 0, 16, height}, Codec::kJpegAtlas, 50, false};
    writer.add(f, [](ByteBuffer& out) { out.resize(10000, 0); });
    for (int i = 1; i < members; i++) writer.add_member(f);
    std::string reason;
    return parse_answer(writer.finish(), &reason) ? "" : reason;
  };
  EXPECT_EQ(atlas_of(256, 1), "");
  EXPECT_EQ(atlas_of(257, 1), "fragments[0].codec: an atlas of more than 256 fragments");
  EXPECT_EQ(atlas_of(2, 8192), "");
  EXPECT_EQ(atlas_of(2, 8193), "fragments[0].codec: an atlas of more than 16384 lines");
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
    const std::span<const FragmentView> all = view->fragments;
    for (size_t k = 0, n; k < all.size(); k += n) {
      n = group_size(all.subspan(k));
      ASSERT_GE(n, 1u);
      for (const FragmentView& f : all.subspan(k, n)) {
        ASSERT_FALSE(f.rect.empty());
        ASSERT_LE(f.rect.x1, f.plain ? kMaxImageSize : view->view_width);
        ASSERT_LE(f.rect.y1, f.plain ? kMaxImageSize : view->view_height);
      }
      if (all[k].codec == Codec::kRaw16) {
        ASSERT_EQ(all[k].payload.size(), raw_size(all[k]));
        decoder.sums(all[k]);
      } else {
        damaged += decoder.decode(all.subspan(k, n)).empty();
      }
    }
  }
  EXPECT_GT(parsed, 1000);
  EXPECT_LT(parsed, 5500);
  EXPECT_GT(damaged, 50);
}

}  // namespace
}  // namespace lf::wire
