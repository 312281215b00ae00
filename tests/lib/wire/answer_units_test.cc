// SPDX-License-Identifier: LGPL-2.1-or-later
#include "support/answer_codec.h"

#include <gtest/gtest.h>

#include <random>

#include "base/error.h"
#include "lib/wire/wire_test.h"
#include "wire/answer_parser.h"
#include "wire/limits.h"

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

std::string reason_of(const std::vector<uint8_t>& bytes) {
  std::string reason;
  EXPECT_FALSE(decode_answer(bytes, &reason).has_value());
  EXPECT_FALSE(decode_answer(bytes).has_value());
  return reason;
}

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
    const std::optional<Answer> decoded = decode_answer(bytes, &reason);
    ASSERT_TRUE(decoded.has_value()) << reason;
    EXPECT_EQ(*decoded, answer);
    const AnswerHeader& header = answer;
    const auto n = static_cast<uint32_t>(answer.fragments.size());
    const size_t header_bytes = 72 + 4 * (answer.cameras.ranges().size() + answer.blind.ranges().size());
    EXPECT_EQ(parse_answer_header(bytes), (AnswerPartHeader{header, {0, n, n}}));
    EXPECT_EQ(parse_answer_header(std::span(bytes).first(header_bytes)), (AnswerPartHeader{header, {0, n, n}}));
    EXPECT_FALSE(parse_answer_header(std::span(bytes).first(header_bytes - 1)).has_value());
  }
}

TEST(AnswerCodec, NothingToGiveIsAnAnswer) {
  Answer answer;
  answer.view_width = answer.view_height = 1;
  EXPECT_EQ(encode_answer(answer).size(), 72u);
  EXPECT_EQ(decode_answer(encode_answer(answer)), answer);
}

TEST(AnswerCodec, RefusesEveryTruncation) {
  const std::vector<uint8_t> bytes = from_hex(kGolden);
  for (size_t n = 0; n < bytes.size(); n++) {
    const std::string there = ", there are " + std::to_string(n);
    const std::string plain = reason_of({bytes.begin(), bytes.begin() + n});
    std::string reason;
    EXPECT_EQ(parse_answer_header(std::span(bytes).first(n), &reason).has_value(), n >= 84);
    if (n < 12) {
      EXPECT_EQ(plain, "header: needs 12 bytes" + there);
    } else if (n < 84) {
      EXPECT_EQ(plain, (n < 72 ? "header: needs 72 bytes" : "header: needs 84 bytes") + there);
      EXPECT_EQ(reason, plain);
      EXPECT_EQ(reason_of(resized(bytes, n)), plain);
    } else {
      EXPECT_EQ(plain, "length: the unit says 143 bytes" + there);
      // With a length field that agrees, what is cut is named.
      const std::string cut = reason_of(resized(bytes, n));
      if (n < 124) {
        EXPECT_EQ(cut, "fragments: a table of 2 is longer than the answer") << n;
      } else if (n < 140) {
        EXPECT_EQ(cut, "fragments[0].length: 16 bytes, but " + std::to_string(n - 124) + " are left");
      } else {
        EXPECT_EQ(cut, "fragments[1].length: 3 bytes, but " + std::to_string(n - 140) + " are left");
      }
    }
  }
  EXPECT_EQ(reason_of(resized(bytes, 145)), "length: 2 bytes after the last fragment's payload");
}

TEST(AnswerCodec, NamesTheFieldThatIsWrong) {
  const struct {
    size_t offset;
    int size;
    uint64_t value;
    const char* reason;
  } rows[] = {
      {0, 1, 0x8e, "magic: no answer begins here"},
      {3, 1, 'Q', "magic: no answer begins here"},
      {4, 1, 3, "version: 3 is not supported, only 1"},
      {5, 1, 5, "type: 5 is not supported in answer units"},
      {6, 2, 3, "flags: unknown bits 2"},
      {8, 4, 142, "length: the unit says 142 bytes, there are 143"},
      {8, 4, 0xffffffff, "length: 4294967295 bytes, must be 12 to 1073741824"},
      {48, 2, 0, "view_width: must be 1 to 16384 pixels, is 0"},
      {50, 2, 16385, "view_height: must be 1 to 16384 pixels, is 16385"},
      {52, 1, 3, "family: 3 is unknown"},
      {52, 1, 0, "family: none, but there are 2 fragments"},
      {52, 1, 1, "fragments[0].length: must be 24 bytes, is 16"},
      {53, 1, 1, "reserved: must be 0, is 1"},
      {54, 2, 0xffff, "header: needs 262216 bytes, there are 143"},
      {56, 4, 3, "total: 2 fragments, but this part has 3 from number 0 on"},
      {56, 4, 0xffffffff, "fragments: at most 65536, not 4294967295"},
      {56, 4, 1, "length: 23 bytes after the last fragment's payload"},
      {56, 4, 0, "fragments: a part without any"},
      {60, 4, 1, "total: 2 fragments, but this part has 2 from number 1 on"},
      {60, 4, 0xffffffff, "total: 2 fragments, but this part has 2 from number 4294967295 on"},
      {64, 4, 1, "total: 1 fragments, but this part has 2 from number 0 on"},
      {64, 4, 0xffffffff, "total: at most 65536 fragments, not 4294967295"},
      {64, 4, 3, "total: a part of an answer, not a whole one"},
      {68, 2, 2, "blind[1]: 65535 to 0 is no range beyond the one before"},
      {70, 2, 7, "reserved: must be 0, is 7"},
      {74, 2, 4, "cameras[0]: 5 to 4 is no range beyond the one before"},
      {76, 2, 7, "cameras[1]: 7 to 8 is no range beyond the one before"},
      {78, 2, 0xffff, "cameras: camera 65535 is beyond 65534"},
      {80, 2, 4, "blind: cameras that are not the answer's"},
      {kTable + 2, 2, 1, "fragments[0].plane: 1 is not supported"},
      {kTable + 4, 2, 1, "fragments[0].rectangle: x and y must be even in YCbCr"},
      {kTable + 6, 2, 3, "fragments[0].rectangle: x and y must be even in YCbCr"},
      {kTable + 4, 2, 0xffff, "fragments[0].rectangle: is not inside the view"},
      {kTable + 6, 2, 6, "fragments[0].rectangle: is not inside the view"},
      {kTable + 8, 2, 0, "fragments[0].rectangle: is empty"},
      {kTable + 10, 2, 0, "fragments[0].rectangle: is empty"},
      {kTable + 10, 2, 3, "fragments[0].length: must be 26 bytes, is 16"},
      {kTable + 12, 1, 1, "fragments[0].quality: must be 1 to 100 for JPEG, is 0"},
      {kTable + 12, 1, 2, "fragments[0].length: must be 32 bytes, is 16"},
      {kTable + 12, 1, 3, "fragments[0].codec: 3 is not supported"},
      {kTable + 12, 2, 0x0150, "fragments[0].length: of the first scan is beyond the payload"},
      {kTable + 12, 2, 0x0165, "fragments[0].quality: must be 1 to 100 for JPEG, is 101"},
      {kTable + 13, 1, 80, "fragments[0].quality: must be 0 for raw pixels, is 80"},
      {kTable + 14, 2, 7, "fragments[0].flags: unknown bits"},
      {kTable + 14, 2, 2, "fragments[0].flags: a sum is weighted, and pixels of a camera are not"},
      {kTable + 14, 2, 1, "fragments[0].length: must be 10 bytes, is 16"},
      {kTable + 16, 4, 0xffffffff, "fragments[0].length: must be 16 bytes, is 4294967295"},
      {kSecond + 4, 2, 10, "fragments[1].rectangle: is not inside the view"},
      {kSecond + 16, 4, 4, "fragments[1].length: must be 3 bytes, is 4"},
  };
  for (const auto& row : rows)
    EXPECT_EQ(reason_of(with(from_hex(kGolden), row.offset, row.size, row.value)), row.reason)
        << "offset " << row.offset;
}

TEST(AnswerCodec, EncodesOnlyWhatIsValid) {
  const auto refused = [](const char* reason, auto change) {
    Answer answer = golden_answer();
    change(answer);
    try {
      encode_answer(answer);
      ADD_FAILURE() << "accepted: " << reason;
    } catch (const Error& error) {
      EXPECT_STREQ(error.what(), reason);
    }
  };
  refused("view_width: must be 1 to 16384 pixels, is 70000", [](Answer& a) { a.view_width = 70000; });
  refused("blind: cameras that are not the answer's", [](Answer& a) { a.blind = CameraRanges(CameraSet{7}); });
  refused("family: none, but there are 2 fragments", [](Answer& a) { a.family = PixelFamily::kNone; });
  refused("fragments[0].family: differs from the answer's", [](Answer& a) { a.family = PixelFamily::kRgb; });
  refused("fragments[1].pixels: do not fill the rectangle", [](Answer& a) { a.fragments[1].pixels.pop_back(); });
  refused("fragments[0].lost: does not fill the rectangle", [](Answer& a) { a.fragments[0].lost.pop_back(); });
  refused("fragments[0].rectangle: is not inside the view", [](Answer& a) { a.fragments[0].rect = {-2, 4, 1, 6}; });
  refused("fragments[0].rectangle: is empty", [](Answer& a) { a.fragments[0].rect = {4, 4, 2, 6}; });
}

TEST(AnswerCodec, SurvivesRandomCorruption) {
  std::mt19937 random(2);
  std::vector<std::vector<uint8_t>> answers;
  while (answers.size() < 64) answers.push_back(encode_answer(random_answer(random, 12)));
  int accepted = 0;
  for (int i = 0; i < 100'000; i++) {
    std::vector<uint8_t> bytes = answers[i % answers.size()];
    if (i % 8 == 0) bytes = resized(std::move(bytes), random() % (bytes.size() + 8));
    if (bytes.empty()) continue;
    corrupt(bytes, 100, random);
    const std::optional<AnswerPartHeader> header = parse_answer_header(bytes);
    const std::optional<Answer> decoded = decode_answer(bytes);
    if (!decoded) continue;
    accepted++;
    ASSERT_TRUE(header.has_value());
    ASSERT_EQ(encode_answer(*decoded), bytes);
  }
  EXPECT_GT(accepted, 10'000);
  EXPECT_LT(accepted, 90'000);
}

TEST(AnswerCodec, LargeAnswersAreOneCopy) {
  Answer answer;
  answer.view_width = answer.view_height = 2048;
  answer.family = PixelFamily::kRgb;
  answer.fragments.push_back({PixelFamily::kRgb, {0, 0, 2048, 2048}, std::vector<uint8_t>(2048 * 2048 * 3, 7), {}});
  const std::vector<uint8_t> bytes = encode_answer(answer);
  EXPECT_EQ(bytes.size(), 92u + 2048 * 2048 * 3);
  EXPECT_EQ(bytes.capacity(), bytes.size());
  EXPECT_EQ(decode_answer(bytes), answer);
}

}  // namespace
}  // namespace lf::wire
