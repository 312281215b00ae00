// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/answer_codec.h"
#include "base/text.h"
#include "lib/wire/wire_test.h"
#include "support/answers.h"
#include "support/expect_error.h"
#include "wire/fragment_codec.h"
#include "wire/unit.h"

namespace lf::wire {
namespace {

// Written from spec.md, not by the encoder.
const char kGolden[] =
    "8f4c4641010100010000008f0000000700000009000000003b9aca00000000003b9aca7b112233445566778800000003"
    "000900070200000200000002000000000000000200010000000500060008000800060006ffff0000000200040003000200000003"
    "00000010ffff0000000800060001000100000001"
    "000000030102030405060708090a00ff00070000c8807f";
constexpr size_t kTable = 84, kSecond = 104;

Answer golden_answer() {
  Answer a;
  a.view_id = 7;
  a.sequence = 9;
  a.view_width = 9;
  a.view_height = 7;
  a.family = PixelFamily::kI420;
  a.target_time = 1'000'000'000;
  a.actual_time = 1'000'000'123;
  a.rig_hash = 0x1122334455667788;
  a.node = 3;
  a.cameras = CameraRanges(CameraSet{5, 6, 8});
  a.blind = CameraRanges(CameraSet{6});
  a.fragments = {{PixelFamily::kI420, {2, 4, 5, 6}, {1, 2, 3, 4, 5, 6, 7, 8, 9, 10}, {0, 255, 0, 7, 0, 0}},
                 {PixelFamily::kI420, {8, 6, 9, 7}, {200, 0x80, 0x7f}, {}}};
  return a;
}

Answer random_answer(std::mt19937& random, int max_size) {
  const auto below = [&](int n) { return static_cast<int>(random() % n); };
  Answer a;
  a.view_id = random();
  a.sequence = random();
  a.view_width = 1 + below(max_size);
  a.view_height = 1 + below(max_size);
  a.target_time = below(3) ? random() : kNoTime;
  a.actual_time = below(3) ? random() : kNoTime;
  a.rig_hash = (uint64_t{random()} << 32) | random();
  a.node = random();
  a.last_of_node = below(2);
  CameraSet cameras, blind;
  for (CameraIndex camera = 0; camera < 12; camera++) {
    if (below(3)) cameras.push_back(camera);
    if (!cameras.empty() && cameras.back() == camera && !below(4)) blind.push_back(camera);
  }
  a.cameras = CameraRanges(cameras);
  a.blind = CameraRanges(blind);
  a.family = static_cast<PixelFamily>(below(3));
  if (a.family == PixelFamily::kNone) return a;
  const int align = a.family == PixelFamily::kI420 ? ~1 : ~0;
  for (int n = below(5); n > 0; n--) {
    Fragment f;
    f.family = a.family;
    f.rect.x0 = below(a.view_width) & align;
    f.rect.y0 = below(a.view_height) & align;
    f.rect.x1 = f.rect.x0 + 1 + below(a.view_width - f.rect.x0);
    f.rect.y1 = f.rect.y0 + 1 + below(a.view_height - f.rect.y0);
    f.pixels.resize(packed_size(f.family, f.rect.width(), f.rect.height()));
    if (below(2)) f.lost.resize(static_cast<size_t>(f.rect.width()) * f.rect.height());
    for (uint8_t& v : f.pixels) v = static_cast<uint8_t>(random());
    for (uint8_t& v : f.lost) v = static_cast<uint8_t>(random());
    a.fragments.push_back(std::move(f));
  }
  return a;
}

constexpr auto reason_of = refusal<decode_answer>;

TEST(AnswerCodec, GoldenBytes) {
  EXPECT_EQ(encode_answer(golden_answer()), from_hex(kGolden));
  EXPECT_EQ(decode_answer(from_hex(kGolden)), golden_answer());
}

TEST(AnswerCodec, RoundTrips) {
  std::mt19937 random(1);
  for (int i = 0; i < 1000; i++) {
    const Answer answer = random_answer(random, 40);
    const std::vector<uint8_t> bytes = encode_answer(answer);
    std::string reason;
    EXPECT_EQ(decode_answer(bytes, &reason), answer) << reason;
    const AnswerHeader& header = answer;
    const auto n = static_cast<uint32_t>(answer.fragments.size());
    const size_t header_bytes = 72 + 4 * (answer.cameras.ranges().size() + answer.blind.ranges().size());
    EXPECT_EQ(parse_answer_header(bytes), (AnswerPartHeader{header, {0, n, n}}));
    EXPECT_EQ(parse_answer_header(std::span(bytes).first(header_bytes)), (AnswerPartHeader{header, {0, n, n}}));
    EXPECT_FALSE(parse_answer_header(std::span(bytes).first(header_bytes - 1)).has_value());
  }
}

TEST(AnswerCodec, EmptyAnswerIsValid) {
  Answer answer;
  answer.view_width = answer.view_height = 1;
  EXPECT_EQ(encode_answer(answer).size(), 72u);
  EXPECT_EQ(decode_answer(encode_answer(answer)), answer);
}

TEST(AnswerCodec, RefusesEveryTruncation) {
  const std::vector<uint8_t> bytes = from_hex(kGolden);
  for (size_t n = 0; n < bytes.size(); n++) {
    const std::string there = std::to_string(n);
    const std::string plain = reason_of({bytes.begin(), bytes.begin() + n});
    std::string reason;
    EXPECT_EQ(parse_answer_header(std::span(bytes).first(n), &reason).has_value(), n >= 84);
    if (n < 12) {
      EXPECT_MENTIONS(plain, "header", "12 bytes", there);
    } else if (n < 84) {
      EXPECT_MENTIONS(plain, "header", n < 72 ? "72 bytes" : "84 bytes", there);
      EXPECT_EQ(reason, plain);
      EXPECT_EQ(reason_of(resized(bytes, n)), plain);
    } else {
      EXPECT_MENTIONS(plain, "length", "143 bytes", there);
      // The error names the truncated field if the length field matches.
      const std::string cut = reason_of(resized(bytes, n));
      if (n < 124) {
        EXPECT_MENTIONS(cut, "fragments", "table of 2") << n;
      } else if (n < 140) {
        EXPECT_MENTIONS(cut, "fragments[0].length", "16 bytes", std::to_string(n - 124));
      } else {
        EXPECT_MENTIONS(cut, "fragments[1].length", "3 bytes", std::to_string(n - 140));
      }
    }
  }
  EXPECT_MENTIONS(reason_of(resized(bytes, 145)), "length", "2 bytes");
}

TEST(AnswerCodec, ErrorsNameTheField) {
  const WrongField rows[] = {
      {0, 1, 0x8e, {"magic"}},
      {3, 1, 'Q', {"magic"}},
      {4, 1, 3, {"version", "3", "1"}},
      {5, 1, 5, {"type", "5"}},
      {6, 2, 3, {"flags", "bits 2"}},
      {8, 4, 142, {"length", "142 bytes", "143"}},
      {8, 4, 0xffffffff, {"length", "4294967295 bytes", "12 to 1073741824"}},
      {48, 2, 0, {"view_width", "1 to 16384 pixels", "0"}},
      {50, 2, 16385, {"view_height", "1 to 16384 pixels", "16385"}},
      {52, 1, 3, {"family", "3"}},
      {52, 1, 0, {"family: none", "2 fragments"}},
      {52, 1, 1, {"fragments[0].length", "24 bytes", "16"}},
      {53, 1, 1, {"reserved", "0", "1"}},
      {54, 2, 0xffff, {"header", "262216 bytes", "143"}},
      {56, 4, 3, {"total", "2 fragments", "3", "number 0"}},
      {56, 4, 0xffffffff, {"fragments:", "65536", "4294967295"}},
      {56, 4, 1, {"length", "23 bytes"}},
      {56, 4, 0, {"fragments", "one fragment"}},
      {60, 4, 1, {"total", "2 fragments", "2", "number 1"}},
      {60, 4, 0xffffffff, {"total", "2 fragments", "2", "number 4294967295"}},
      {64, 4, 1, {"total", "1 fragments", "2", "number 0"}},
      {64, 4, 0xffffffff, {"total", "65536 fragments", "4294967295"}},
      {64, 4, 3, {"total", "whole"}},
      {68, 2, 2, {"blind[1]", "65535 to 0"}},
      {70, 2, 7, {"reserved", "0", "7"}},
      {74, 2, 4, {"cameras[0]", "5 to 4"}},
      {76, 2, 7, {"cameras[1]", "7 to 8"}},
      {78, 2, 0xffff, {"cameras", "camera 65535", "65534"}},
      {80, 2, 4, {"blind", "subset"}},
      {kTable + 2, 2, 1, {"fragments[0].plane", "1"}},
      {kTable + 4, 2, 1, {"fragments[0].rectangle", "even", "YCbCr"}},
      {kTable + 6, 2, 3, {"fragments[0].rectangle", "even", "YCbCr"}},
      {kTable + 4, 2, 0xffff, {"fragments[0].rectangle", "inside"}},
      {kTable + 6, 2, 6, {"fragments[0].rectangle", "inside"}},
      {kTable + 8, 2, 0, {"fragments[0].rectangle", "empty"}},
      {kTable + 10, 2, 0, {"fragments[0].rectangle", "empty"}},
      {kTable + 10, 2, 3, {"fragments[0].length", "26 bytes", "16"}},
      {kTable + 12, 1, 1, {"fragments[0].quality", "1 to 100", "JPEG", "0"}},
      {kTable + 12, 1, 2, {"fragments[0].length", "32 bytes", "16"}},
      {kTable + 12, 1, 3, {"fragments[0].codec", "3"}},
      {kTable + 12, 2, 0x0150, {"fragments[0].length", "scan", "payload"}},
      {kTable + 12, 2, 0x0165, {"fragments[0].quality", "1 to 100", "JPEG", "101"}},
      {kTable + 13, 1, 80, {"fragments[0].quality", "0", "raw", "80"}},
      {kTable + 14, 2, 7, {"fragments[0].flags", "unknown bits"}},
      {kTable + 14, 2, 2, {"fragments[0].flags", "weighted"}},
      {kTable + 14, 2, 1, {"fragments[0].length", "10 bytes", "16"}},
      {kTable + 16, 4, 0xffffffff, {"fragments[0].length", "16 bytes", "4294967295"}},
      {kSecond + 4, 2, 10, {"fragments[1].rectangle", "inside"}},
      {kSecond + 16, 4, 4, {"fragments[1].length", "3 bytes", "4"}},
  };
  expect_reasons(reason_of, from_hex(kGolden), rows);
}

TEST(AnswerCodec, RefusesToEncodeInvalidAnswers) {
  const auto refused = [](const std::vector<std::string>& facts, auto change) {
    Answer answer = golden_answer();
    change(answer);
    EXPECT_ERROR(encode_answer(answer), facts);
  };
  refused({"view_width", "1 to 16384 pixels", "70000"}, [](Answer& a) { a.view_width = 70000; });
  refused({"blind", "subset"}, [](Answer& a) { a.blind = CameraRanges(CameraSet{7}); });
  refused({"family: none", "2 fragments"}, [](Answer& a) { a.family = PixelFamily::kNone; });
  refused({"fragments[0].family", "differs"}, [](Answer& a) { a.family = PixelFamily::kRgb; });
  refused({"fragments[0].rectangle", "inside"}, [](Answer& a) { a.fragments[0].rect = {-2, 4, 1, 6}; });
  refused({"fragments[0].rectangle", "is empty"}, [](Answer& a) { a.fragments[0].rect = {4, 4, 2, 6}; });
}

TEST(AnswerCodec, SurvivesRandomCorruption) {
  std::mt19937 random(2);
  std::vector<std::vector<uint8_t>> answers;
  while (answers.size() < 64) answers.push_back(encode_answer(random_answer(random, 12)));
  expect_corruption_survived(answers, 100, random, [](const auto& bytes) -> std::optional<std::vector<uint8_t>> {
    const std::optional<AnswerPartHeader> header = parse_answer_header(bytes);
    const std::optional<Answer> decoded = decode_answer(bytes);
    if (!decoded) return {};
    EXPECT_TRUE(header.has_value());
    return encode_answer(*decoded);
  });
}

TEST(AnswerCodec, LargeAnswersAreCopiedOnce) {
  Answer answer;
  answer.view_width = answer.view_height = 2048;
  answer.family = PixelFamily::kRgb;
  answer.fragments.push_back({PixelFamily::kRgb, {0, 0, 2048, 2048}, std::vector<uint8_t>(2048 * 2048 * 3, 7), {}});
  const std::vector<uint8_t> bytes = encode_answer(answer);
  EXPECT_EQ(bytes.size(), 92u + 2048 * 2048 * 3);
  EXPECT_EQ(bytes.capacity(), bytes.size());
  EXPECT_EQ(decode_answer(bytes), answer);
}

FragmentHeader fragment(PixelFamily family, const Rect& rect, Codec codec, bool lost) {
  return {3, family, rect, codec, 0, lost};
}

TEST(Payload, RawSizesMatchTheSpecification) {
  const Rect rect{2, 2, 7, 5};  // 5 x 3
  const struct {
    PixelFamily family;
    Codec codec;
    bool lost;
    size_t size;
  } rows[] = {{PixelFamily::kRgb, Codec::kRaw, false, 45},    {PixelFamily::kRgb, Codec::kRaw, true, 60},
              {PixelFamily::kI420, Codec::kRaw, false, 27},   {PixelFamily::kI420, Codec::kRaw, true, 42},
              {PixelFamily::kRgb, Codec::kRaw16, false, 90},  {PixelFamily::kRgb, Codec::kRaw16, true, 120},
              {PixelFamily::kI420, Codec::kRaw16, false, 54}, {PixelFamily::kI420, Codec::kRaw16, true, 84}};
  for (const auto& row : rows) EXPECT_EQ(raw_size(fragment(row.family, rect, row.codec, row.lost)), row.size);
}

TEST(Payload, PlanesAreContiguous) {
  alignas(2) uint8_t bytes[120];
  const Rect rect{2, 2, 7, 5};
  const FragmentPlanes raw = raw_planes(fragment(PixelFamily::kI420, rect, Codec::kRaw, true), bytes);
  EXPECT_EQ(raw.plane[1] - raw.plane[0], 15);
  EXPECT_EQ(raw.plane[2] - raw.plane[1], 6);
  EXPECT_EQ(raw.lost - raw.plane[2], 6);
  EXPECT_EQ(raw.stride[1], 3);
  const SumPlanes ycc = raw16_planes(fragment(PixelFamily::kI420, rect, Codec::kRaw16, true), bytes);
  EXPECT_EQ(ycc.plane[2] - ycc.plane[0], 21);
  EXPECT_EQ(reinterpret_cast<uint8_t*>(ycc.lost) - bytes, 54);
  const SumPlanes rgb = raw16_planes(fragment(PixelFamily::kRgb, rect, Codec::kRaw16, false), bytes);
  EXPECT_EQ(rgb.plane[2] - rgb.plane[0], 30);
  EXPECT_EQ(rgb.stride[2], 5);
  EXPECT_EQ(rgb.lost, nullptr);
}

TEST(Payload, ScansAreSplitAtTheirLength) {
  const uint8_t bytes[] = {0, 0, 0, 2, 10, 11, 12};
  EXPECT_EQ(split_scans(bytes, false)->pixels.size(), 7u);
  const auto two = split_scans(bytes, true).value();
  EXPECT_EQ(two.pixels.data(), bytes + 4);
  EXPECT_EQ(two.pixels.size(), 2u);
  EXPECT_EQ(two.lost.size(), 1u);
  EXPECT_FALSE(split_scans(std::span(bytes).first(5), true).has_value());
  EXPECT_FALSE(split_scans(std::span(bytes).first(3), true).has_value());
  EXPECT_FALSE(split_scans({}, true).has_value());
}

TEST(AnswerParts, AcceptAnyOrder) {
  AnswerParts parts;
  EXPECT_FALSE(parts.complete());
  EXPECT_TRUE(parts.add({7, 3, 10}));
  EXPECT_TRUE(parts.add({0, 4, 10}));
  EXPECT_FALSE(parts.complete());
  EXPECT_TRUE(parts.add({4, 3, 10}));
  EXPECT_TRUE(parts.complete());
  parts.clear();
  EXPECT_FALSE(parts.complete());
}

TEST(AnswerParts, AnswerWithoutFragmentsIsComplete) {
  AnswerParts parts;
  EXPECT_TRUE(parts.add({0, 0, 0}));
  EXPECT_TRUE(parts.complete());
  EXPECT_FALSE(parts.add({0, 0, 0}));
}

TEST(AnswerParts, IgnoreRepetitionsAndContradictions) {
  AnswerParts parts;
  EXPECT_TRUE(parts.add({4, 4, 10}));
  EXPECT_FALSE(parts.add({4, 4, 10}));
  EXPECT_FALSE(parts.add({6, 4, 10}));
  EXPECT_FALSE(parts.add({2, 3, 10}));
  EXPECT_FALSE(parts.add({0, 10, 10}));
  EXPECT_FALSE(parts.add({5, 1, 10}));
  EXPECT_FALSE(parts.add({0, 4, 9}));
  EXPECT_TRUE(parts.add({8, 2, 10}));
  EXPECT_TRUE(parts.add({0, 4, 10}));
  EXPECT_TRUE(parts.complete());
}

constexpr size_t kMixedTable = 72, kEntry = 20, kCodec = 12, kQuality = 13, kFlags = 14, kLength = 16;

std::vector<uint8_t> to_vector(const ByteBuffer& bytes) { return {bytes.begin(), bytes.end()}; }

std::string reason_of_both(const std::vector<uint8_t>& bytes) {
  std::string reason;
  EXPECT_FALSE(parse_answer(bytes, &reason).has_value());
  EXPECT_FALSE(decode_answer(bytes).has_value());
  return reason;
}

// A 16-bit sum, three JPEG fragments (the first with missing weight), one raw fragment, then a camera's pixels.
std::vector<uint8_t> mixed() {
  const AnswerHeader header = header_of_view(PixelFamily::kI420, 400, 400);
  AnswerWriter writer(header, 6);
  const SumPlanes sums = writer.add_sums({{}, header.family, {0, 0, 6, 4}, Codec::kRaw16, 0, false});
  std::fill_n(sums.plane[0], 24 + 2 * 6, int16_t{1280});
  for (const Fragment& f : patterned_fragments(header.family, 3, 40, 30))
    writer.add({{}, f.family, f.rect, Codec::kJpeg, 80, !f.lost.empty()},
               [&](ByteBuffer& out) { append_jpeg(planes_of(f), 80, out); });
  std::ranges::fill(writer.add({{}, header.family, {2, 2, 3, 3}, Codec::kRaw, 0, true}), uint8_t{5});
  std::ranges::fill(writer.add({9, header.family, {600, 2, 602, 4}, Codec::kRaw, 0, false}), uint8_t{6});
  return to_vector(writer.finish());
}

TEST(AnswerParser, DoesNotCopy) {
  const std::vector<uint8_t> bytes = mixed();
  const AnswerView view = parsed(bytes);
  ASSERT_EQ(view.fragments.size(), 6u);
  const uint8_t* next = bytes.data() + kMixedTable + 6 * kEntry;
  for (const FragmentView& f : view.fragments) {
    EXPECT_EQ(f.payload.data(), next);
    next += f.payload.size();
  }
  EXPECT_EQ(next, bytes.data() + bytes.size());
  EXPECT_EQ(view.fragments[3].codec, Codec::kJpeg);
  EXPECT_FALSE(view.fragments[4].camera);
  EXPECT_EQ(view.fragments[5].camera, 9u);
  EXPECT_EQ(parse_answer_header(bytes), static_cast<const AnswerPartHeader&>(view));
  EXPECT_EQ(peek_answer_view(bytes), view.view_id);
  EXPECT_EQ(peek_answer_view(std::span(bytes).first(16)), view.view_id) << "the rest is not read";
  EXPECT_FALSE(peek_answer_view(std::span(bytes).first(15)));
}

TEST(AnswerParser, RefusesEveryTruncation) {
  const std::vector<uint8_t> bytes = mixed();
  for (size_t n = 0; n < bytes.size(); n++) {
    EXPECT_FALSE(parse_answer(std::span(bytes).first(n)).has_value()) << n;
    EXPECT_FALSE(parse_answer(resized(bytes, n)).has_value()) << n;
  }
  EXPECT_MENTIONS(reason_of_both(resized(bytes, bytes.size() + 1)), "length", "1 bytes");
}

TEST(AnswerParser, ErrorsNameThePayload) {
  const std::vector<uint8_t> bytes = mixed();
  const std::span<const uint8_t> payload = parsed(bytes).fragments[1].payload;
  const size_t jpeg = payload.data() - bytes.data();
  const auto jpeg_length = static_cast<uint32_t>(payload.size());
  const auto at = [](size_t entry, size_t field) { return kMixedTable + entry * kEntry + field; };
  const WrongField rows[] = {
      {jpeg, 4, jpeg_length, {"fragments[1].length", "scan", "payload"}},
      {jpeg, 4, jpeg_length - 4, {"fragments[1].length", "15 bytes", "0"}},
      {jpeg, 4, 11, {"fragments[1].length", "24 bytes", "11"}},
      {jpeg, 4, 0xffffffff, {"fragments[1].length", "scan", "payload"}},
      {at(2, kQuality), 1, 0, {"fragments[2].quality", "1 to 100", "JPEG", "0"}},
      {at(2, kQuality), 1, 101, {"fragments[2].quality", "1 to 100", "JPEG", "101"}},
      {at(3, 10), 2, 388, {"fragments[3].length", "300 bytes"}},
      {at(0, kQuality), 1, 1, {"fragments[0].quality", "0", "raw", "1"}},
      {at(0, kLength), 4, 71, {"fragments[0].length", "72 bytes", "71"}},
      {at(0, kFlags), 2, 3, {"fragments[0].length", "120 bytes", "72"}},
      {at(0, kCodec), 1, 0, {"fragments[0].length", "36 bytes", "72"}},
      {at(4, kCodec), 1, 2, {"fragments[4].length", "8 bytes", "4"}},
      {at(4, kCodec), 1, 3, {"fragments[4].codec", "3"}},
      {at(4, kLength), 4, jpeg_length, {"fragments[4].length", "4 bytes", std::to_string(jpeg_length)}},
      {at(5, 0), 2, 0xffff, {"fragments[5].rectangle", "inside"}},
      {at(5, kFlags), 2, 1, {"fragments[5].flags", "weighted"}},
      {at(5, kFlags), 2, 2, {"fragments[5].flags", "missing weight"}},
      {at(5, kCodec), 1, 2, {"fragments[5].codec", "16-bit", "sums"}},
  };
  expect_reasons(reason_of_both, bytes, rows);
}

TEST(AnswerParser, SixteenBitValuesStartAtEvenOffsets) {
  AnswerWriter writer(header_of_view(PixelFamily::kRgb, 8, 8), 2);
  writer.add({{}, PixelFamily::kRgb, {0, 0, 2, 1}, Codec::kRaw, 0, false});
  writer.add_sums({{}, PixelFamily::kRgb, {0, 0, 1, 1}, Codec::kRaw16, 0, false});
  std::vector<uint8_t> bytes = to_vector(writer.finish());
  EXPECT_TRUE(parse_answer(bytes).has_value());
  bytes = resized(with(with(bytes, kMixedTable + 8, 2, 1), kMixedTable + kLength, 4, 3), bytes.size() - 3);
  EXPECT_MENTIONS(reason_of_both(bytes), "fragments[1].codec", "16-bit", "even");
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
    corrupt(bad, kMixedTable + 6 * kEntry, random);
    // Exactly sized memory, so that a sanitizer detects reads beyond the end.
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

constexpr auto kRgb = PixelFamily::kRgb;

void append_bytes(ByteBuffer& out, int n) { out.insert(out.end(), static_cast<size_t>(n), uint8_t{0}); }

TEST(AnswerWriter, PartsOfAnAnswer) {
  const AnswerHeader header = header_of_view(PixelFamily::kRgb, 8, 8);
  AnswerWriter writer(header, 2);
  std::ranges::fill(writer.add({1, header.family, {0, 0, 2, 2}}), uint8_t{3});
  writer.set_part(4, 9);
  const ByteBuffer bytes = writer.finish();
  EXPECT_EQ(parsed(bytes).part, (AnswerPart{4, 1, 9}));
  EXPECT_EQ(parse_answer_header(bytes).value().part, (AnswerPart{4, 1, 9}));
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

  const AnswerView view = parsed(bytes);
  EXPECT_EQ(static_cast<const AnswerHeader&>(view), header);
  ASSERT_EQ(view.fragments.size(), 3u);
  EXPECT_EQ(static_cast<const FragmentHeader&>(view.fragments[0]), sums);
  EXPECT_EQ(static_cast<const FragmentHeader&>(view.fragments[1]), raw);
  EXPECT_EQ(static_cast<const FragmentHeader&>(view.fragments[2]), jpeg);
  const uint8_t* const first = view.fragments[0].payload.data();
  EXPECT_EQ(first - bytes.data(), 132);
  EXPECT_EQ(first[0], 0xfd);  // -3, little-endian
  EXPECT_EQ(first[1], 0xff);
  EXPECT_EQ(raw16_planes(view.fragments[0], first).plane[2][8], 205);
  EXPECT_EQ(raw16_planes(view.fragments[0], first).lost[1], 32767);
  EXPECT_EQ(view.fragments[1].payload[5], 77);
  EXPECT_EQ(view.fragments[2].payload.size(), 5u);
}

TEST(AnswerWriter, EmptyPlanesOfMissingWeightAreDropped) {
  for (int which = 0; which < 8; which++) {  // bit i: fragment i has no missing weight
    AnswerWriter writer(header_of_view(kRgb, 8, 8), 3), expected(header_of_view(kRgb, 8, 8), 3);
    for (int i = 0; i < 3; i++) {
      const bool none = which >> i & 1;
      const FragmentHeader with{{}, kRgb, {0, 2 * i, 3 + i, 2 * i + 2}, Codec::kRaw16, 0, true};
      FragmentHeader without = with;
      without.has_missing = !none;
      const std::span<uint8_t> bytes = writer.add(with), wanted = expected.add(without);
      for (size_t k = 0; k < bytes.size(); k++) bytes[k] = static_cast<uint8_t>(50 * i + k);
      std::copy_n(bytes.begin(), wanted.size(), wanted.begin());
    }
    writer.drop_missing([&](size_t i) { return which >> i & 1; });
    EXPECT_EQ(writer.fragments(), 3u);
    EXPECT_EQ(writer.finish(), expected.finish()) << which;
  }
  AnswerWriter raw(header_of_view(kRgb, 8, 8), 1);
  raw.add({{}, kRgb, {0, 0, 2, 2}, Codec::kRaw, 0, true});
  EXPECT_THROW(raw.drop_missing([](size_t) { return true; }), Error);
}

TEST(AnswerWriter, FewerFragmentsMoveThePayloads) {
  for (int given = 0; given <= 3; given++) {
    AnswerWriter writer(header_of_view(kRgb, 8, 8), 3), exact(header_of_view(kRgb, 8, 8), given);
    for (AnswerWriter* w : {&writer, &exact})
      for (int i = 0; i < given; i++)
        std::ranges::fill(w->add({static_cast<CameraIndex>(i), kRgb, {0, 0, 2, 2}, Codec::kRaw, 0, false}),
                          static_cast<uint8_t>(i));
    EXPECT_EQ(writer.finish(), exact.finish());
  }
}

TEST(AnswerWriter, ReusesMemory) {
  ByteBuffer old(1000, 0xee);
  const uint8_t* const where = old.data();
  AnswerWriter writer(header_of_view(kRgb, 8, 8), 1, std::move(old));
  writer.add({0, kRgb, {0, 0, 8, 8}, Codec::kRaw, 0, false});
  const ByteBuffer bytes = writer.finish();
  EXPECT_EQ(bytes.data(), where);
  EXPECT_EQ(bytes.size(), 92u + 192);
}

TEST(AnswerWriter, RefusesInvalidAnswers) {
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
  EXPECT_ERROR(AnswerWriter(header_of_view(kRgb, 0, 8), 0), "view_width", "1 to 16384 pixels", "0");
  EXPECT_ERROR(adds(changed([](FragmentHeader& f) { f.rect.x1 = 9; })), "fragments[0].rectangle", "inside");
  EXPECT_ERROR(adds(changed([](FragmentHeader& f) { f.family = PixelFamily::kI420; })), "fragments[0].family",
               "differs");
  EXPECT_ERROR(adds(changed([](FragmentHeader& f) { f.quality = 1; })), "fragments[0].quality", "0", "raw", "1");
  EXPECT_ERROR(adds(changed([](FragmentHeader& f) { f.codec = Codec::kJpeg; })), "fragments[0].quality", "1 to 100",
               "JPEG", "0");

  AnswerWriter writer(header_of_view(kRgb, 8, 8), 2);
  EXPECT_ERROR(writer.add(good, [](ByteBuffer& out) { append_bytes(out, 26); }), "fragments[0].length", "26 bytes",
               "size and codec");
  AnswerWriter odd(header_of_view(kRgb, 8, 8), 2);
  odd.add(good);  // 27 bytes
  EXPECT_ERROR(odd.add_sums({{}, kRgb, {0, 0, 3, 3}, Codec::kRaw16, 0, false}), "fragments[1].codec", "16-bit", "even");
  odd.add(good);
  EXPECT_ERROR(odd.add(good), "fragments:", "2", "room");
}

}  // namespace
}  // namespace lf::wire
