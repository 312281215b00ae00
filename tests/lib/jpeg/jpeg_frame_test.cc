// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/jpeg_frame.h"
#include "support/jpeg_samples.h"
#include "support/test.h"

namespace lf {
namespace {

using test::JpegKind;

// Returns success if the region equals libjpeg's output, including the chroma samples of all its pixels.
testing::AssertionResult equal_inside(const Rect& region, const ImageView& got, const Image& truth) {
  const ImageView want = truth.view();
  for (int i = 0; i < 3; i++) {
    const int half = i > 0;
    const Rect r{region.x0 >> half, region.y0 >> half, (region.x1 + half) >> half, (region.y1 + half) >> half};
    for (int y = r.y0; y < r.y1; y++)
      for (int x = r.x0; x < r.x1; x++) {
        const int a = got.plane[i][y * got.stride[i] + x], b = want.plane[i][y * want.stride[i] + x];
        if (a != b)
          return testing::AssertionFailure()
                 << "plane " << i << " (" << x << ", " << y << "): " << a << " instead of " << b;
      }
  }
  return testing::AssertionSuccess();
}

Rect random_region(int width, int height, std::mt19937& random) {
  const auto below = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  const int x = below(width), y = below(height);
  return {x, y, x + 1 + below(width - x), y + 1 + below(height - y)};
}

struct Case {
  const char* name;
  JpegKind kind;
};

class EveryKind : public testing::TestWithParam<Case> {};

TEST_P(EveryKind, RegionsEqualLibjpeg) {
  std::mt19937 random(7);
  for (const auto& [width, height] : {std::pair{160, 96}, {161, 97}, {147, 130}, {35, 250}, {9, 7}, {1, 1}})
    for (const int quality : {30, 88, 100})
      for (const int interval : {0, 1, 5, -1}) {
        JpegKind kind = GetParam().kind;
        kind.quality = quality;
        kind.restart_interval = interval >= 0 ? interval : (width + 8 * kind.h - 1) / (8 * kind.h);
        const auto jpeg = test::encode_jpeg(test::noisy_picture(width, height, 3), kind);
        const Image truth = test::to_i420(test::decode_raw(jpeg));
        const auto shared = test::open_jpeg(jpeg);
        for (int i = 0; i < 6; i++) {
          const Rect region = random_region(width, height, random);
          SCOPED_TRACE(testing::Message()
                       << width << "x" << height << " quality " << quality << " interval " << interval << " region "
                       << region.x0 << " " << region.y0 << " " << region.x1 << " " << region.y1);
          for (const auto& frame : {shared, test::open_jpeg(jpeg)}) {
            std::string reason;
            ASSERT_TRUE(frame->ensure(region, &reason)) << reason;
            ASSERT_TRUE(equal_inside(region, frame->view(), truth));
          }
        }
      }
}

INSTANTIATE_TEST_SUITE_P(JpegFrame, EveryKind,
                         testing::Values(Case{"yuv420", {}}, Case{"yuv422", {.v = 1}}, Case{"yuv440", {.h = 1}},
                                         Case{"yuv444", {.h = 1, .v = 1}},
                                         // FFmpeg's form of 4:2:2.
                                         Case{"yuv422_as_2212", {.chroma_v = 2}},
                                         Case{"grey", {.grey = true, .h = 1, .v = 1}},
                                         Case{"own_tables", {.optimise = true}}),
                         [](const auto& info) { return info.param.name; });

class WholeFrames : public testing::TestWithParam<Case> {};

TEST_P(WholeFrames, EqualLibjpeg) {
  for (const auto& [width, height] : {std::pair{160, 96}, {51, 33}, {1, 1}}) {
    const auto jpeg = test::encode_jpeg(test::noisy_picture(width, height, 4), GetParam().kind);
    const Image truth = test::to_i420(test::decode_raw(jpeg));
    const auto frame = test::open_jpeg(jpeg);
    std::string reason;
    ASSERT_TRUE(frame->ensure({0, 0, 1, 1}, &reason)) << reason;
    const uint8_t* const pixels = frame->view().plane[0];
    ASSERT_TRUE(frame->ensure({0, 0, width, height}));
    EXPECT_EQ(frame->view().plane[0], pixels);
    EXPECT_TRUE(equal_inside({0, 0, width, height}, frame->view(), truth));
  }
}

INSTANTIATE_TEST_SUITE_P(JpegFrame, WholeFrames,
                         testing::Values(Case{"progressive", {.progressive = true}},
                                         Case{"progressive422", {.v = 1, .progressive = true}},
                                         Case{"progressive444", {.h = 1, .v = 1, .progressive = true}},
                                         Case{"progressive_grey", {.grey = true, .h = 1, .v = 1, .progressive = true}},
                                         Case{"arithmetic", {.arithmetic = true}},
                                         Case{"one_by_one", {.one_by_one = true}}),
                         [](const auto& info) { return info.param.name; });

TEST(JpegFrame, RgbIsConverted) {
  const auto jpeg = test::encode_jpeg(test::noisy_picture(40, 24, 5), {.h = 1, .v = 1, .rgb = true});
  const auto frame = test::open_jpeg(jpeg);
  ASSERT_TRUE(frame->ensure({3, 3, 9, 9}));
  const auto rgb = jpeg::decode_rgb(jpeg, nullptr).value();
  EXPECT_TRUE(equal_inside({0, 0, 40, 24}, frame->view(), to_i420(rgb)));
}

// Versions in the JFIF marker.
TEST(JpegFrame, UnknownVersionsAreAccepted) {
  for (const bool progressive : {false, true}) {
    auto jpeg = test::encode_jpeg(test::noisy_picture(51, 33, 4), {.progressive = progressive});
    const Image truth = test::to_i420(test::decode_raw(jpeg));
    ASSERT_EQ(jpeg[6], 'J');
    jpeg[11] = 9;
    const auto frame = test::open_jpeg(jpeg);
    std::string reason;
    ASSERT_TRUE(frame->ensure({0, 0, 51, 33}, &reason)) << reason;
    EXPECT_TRUE(equal_inside({0, 0, 51, 33}, frame->view(), truth));
  }
}

TEST(JpegFrame, DecodesSamplingBeyondHalfResolution) {
  const auto jpeg = test::encode_jpeg(test::noisy_picture(100, 60, 4), {.h = 4, .v = 1});
  const auto frame = test::open_jpeg(jpeg);
  ASSERT_TRUE(frame->ensure({0, 0, 100, 60}));
  const test::RawPlanes raw = test::decode_raw(jpeg);
  const ImageView view = frame->view();
  for (int y = 0; y < 30; y++)
    for (int x = 0; x < 50; x++) {
      const auto at = [&](int v) { return raw.planes[1].samples[(2 * y + v) * raw.planes[1].stride + x / 2]; };
      ASSERT_EQ(view.plane[1][y * view.stride[1] + x], (at(0) + at(1) + 1) / 2);
    }
}

TEST(JpegFrame, MissingHuffmanTablesAreStandard) {
  const auto whole = test::encode_jpeg(test::noisy_picture(100, 60, 4), {});
  const auto bare = test::without_huffman_tables(whole);
  ASSERT_LT(bare.size(), whole.size() - 400);
  const auto frame = test::open_jpeg(bare);
  ASSERT_TRUE(frame->ensure({30, 20, 80, 50}));
  EXPECT_TRUE(equal_inside({30, 20, 80, 50}, frame->view(), test::to_i420(test::decode_raw(whole))));
}

TEST(JpegFrame, PlanesExistFromTheFirstRegion) {
  const auto frame = test::open_jpeg(test::encode_jpeg(test::noisy_picture(100, 61, 4), {}));
  EXPECT_EQ(frame->width(), 100);
  EXPECT_EQ(frame->height(), 61);
  EXPECT_EQ(frame->view().plane[0], nullptr);
  EXPECT_TRUE(frame->ensure({5, 5, 5, 9}));
  EXPECT_TRUE(frame->ensure({100, 0, 200, 10}));
  EXPECT_EQ(frame->view().plane[0], nullptr) << "nothing requested";
  EXPECT_TRUE(frame->ensure({-100, -100, 1, 1}));
  const ImageView view = frame->view();
  EXPECT_NE(view.plane[0], nullptr);
  EXPECT_TRUE(frame->ensure({0, 0, 1000, 1000}));
  EXPECT_EQ(frame->view().plane[2], view.plane[2]);
  EXPECT_EQ(view.family, PixelFamily::kI420);
  EXPECT_EQ(view.width, 100);
  EXPECT_EQ(view.height, 61);
}

// The maximum width; unused parts must not touch memory.
TEST(JpegFrame, WideFrames) {
  const auto jpeg = test::encode_jpeg(test::noisy_picture(16384, 33, 6), {.restart_interval = 100});
  const Image truth = test::to_i420(test::decode_raw(jpeg));
  const auto frame = test::open_jpeg(jpeg);
  for (const Rect& region : {Rect{16000, 30, 16384, 33}, {5000, 0, 5001, 33}, {7000, 15, 9000, 17}}) {
    ASSERT_TRUE(frame->ensure(region));
    EXPECT_TRUE(equal_inside(region, frame->view(), truth));
  }
}

TEST(JpegFrame, IsSharedByViews) {
  const auto jpeg = test::encode_jpeg(test::noisy_picture(320, 240, 5), {.restart_interval = 7});
  const Image truth = test::to_i420(test::decode_raw(jpeg));
  const auto frame = test::open_jpeg(jpeg);
  std::vector<std::thread> views;
  std::atomic<int> wrong = 0;
  for (unsigned seed = 0; seed < 4; seed++)
    views.emplace_back([&, seed] {
      std::mt19937 random(seed);
      for (int i = 0; i < 50; i++) {
        const Rect region = random_region(320, 240, random);
        if (!frame->ensure(region) || !equal_inside(region, frame->view(), truth)) wrong++;
      }
    });
  for (std::thread& view : views) view.join();
  EXPECT_EQ(wrong, 0);
}

// Damaged frames cause errors, never crashes. Run under sanitizers (tests/sanitize.sh address jpeg).

const JpegKind kKinds[] = {{},
                           {.restart_interval = 5},
                           {.v = 1, .restart_interval = 1},
                           {.h = 1, .v = 1, .optimise = true},
                           {.grey = true, .h = 1, .v = 1, .restart_interval = 12},
                           {.progressive = true},
                           {.one_by_one = true}};

// Requests a few regions, then the whole frame. Returns true if the whole frame could be decoded.
bool try_all(const std::vector<uint8_t>& jpeg) {
  std::string reason;
  const auto frame = test::open_jpeg(jpeg, &reason);
  if (!frame) {
    EXPECT_FALSE(reason.empty());
    return false;
  }
  const int w = frame->width(), h = frame->height();
  bool all = true;
  for (const Rect& region : {Rect{w / 3, h / 3, w / 2, h / 2}, {w - 5, h - 5, w, h}, {0, 0, w / 4, h}, {0, 0, w, h}}) {
    reason.clear();
    all = frame->ensure(region, &reason);
    EXPECT_EQ(all, reason.empty());
  }
  return all;
}

size_t end_of_headers(const std::vector<uint8_t>& jpeg) {
  std::string reason;
  return jpeg::parse_header(jpeg, &reason)->scan;
}

TEST(Damage, TruncatedAnywhere) {
  for (const JpegKind& kind : kKinds) {
    const auto jpeg = test::encode_jpeg(test::noisy_picture(96, 64, 1), kind);
    ASSERT_TRUE(try_all(jpeg));
    for (size_t size = 0; size < jpeg.size() - 4; size += 1 + jpeg.size() / 500)
      EXPECT_FALSE(try_all({jpeg.begin(), jpeg.begin() + static_cast<ptrdiff_t>(size)})) << size;
  }
}

TEST(Damage, RegionsBeforeTheCutAreDecoded) {
  for (const int interval : {0, 6}) {
    const auto jpeg = test::encode_jpeg(test::noisy_picture(96, 64, 1), {.restart_interval = interval});
    const auto frame = test::open_jpeg({jpeg.begin(), jpeg.begin() + static_cast<ptrdiff_t>(jpeg.size() * 2 / 3)});
    EXPECT_TRUE(frame->ensure({0, 0, 96, 16}));
    std::string reason;
    EXPECT_FALSE(frame->ensure({0, 0, 96, 64}, &reason));
    EXPECT_EQ(reason.rfind("damaged in row ", 0), 0u) << reason;
    EXPECT_TRUE(frame->ensure({20, 0, 96, 16}));
  }
}

TEST(Damage, MissingEndOfImageIsAccepted) {
  for (const int interval : {0, 5}) {
    auto jpeg = test::encode_jpeg(test::noisy_picture(96, 64, 1), {.restart_interval = interval});
    jpeg.resize(jpeg.size() - 2);
    EXPECT_TRUE(try_all(jpeg));
    jpeg.insert(jpeg.end(), 100, 0);  // padding to a fixed transfer size
    EXPECT_TRUE(try_all(jpeg));
  }
}

TEST(Damage, FlippedBits) {
  std::mt19937 random(11);
  for (const JpegKind& kind : kKinds) {
    const auto whole = test::encode_jpeg(test::noisy_picture(96, 64, 2), kind);
    const size_t headers = end_of_headers(whole);
    for (int i = 0; i < 1500; i++) {
      auto jpeg = whole;
      // Half of the flips are in the headers, although they are short.
      const size_t begin = i % 2 ? headers : 0, end = i % 2 ? jpeg.size() : headers;
      for (unsigned flips = 1 + random() % 4; flips > 0; flips--)
        jpeg[begin + random() % (end - begin)] ^= static_cast<uint8_t>(1u << random() % 8);
      try_all(jpeg);
    }
  }
}

TEST(Damage, RandomBytesInPlaceOfTheScan) {
  std::mt19937 random(12);
  for (const JpegKind& kind : kKinds) {
    const auto whole = test::encode_jpeg(test::noisy_picture(96, 64, 2), kind);
    for (int i = 0; i < 100; i++) {
      auto jpeg = whole;
      for (size_t k = end_of_headers(whole); k < jpeg.size(); k++)
        jpeg[k] = static_cast<uint8_t>(i % 3 == 0 ? random() | 0xe0 : random());  // long codes, markers
      try_all(jpeg);
    }
  }
}

// Constant bytes give the longest codes, the shortest codes, and no end.
TEST(Damage, ConstantBytesInPlaceOfTheScan) {
  for (const JpegKind& kind : kKinds)
    for (const int value : {0x00, 0x01, 0x55, 0xaa, 0xfe, 0xff}) {
      auto jpeg = test::encode_jpeg(test::noisy_picture(96, 64, 2), kind);
      std::fill(jpeg.begin() + static_cast<ptrdiff_t>(end_of_headers(jpeg)), jpeg.end(), static_cast<uint8_t>(value));
      try_all(jpeg);
    }
}

// Returns the position of the n-th restart marker's number.
size_t nth_restart(const std::vector<uint8_t>& jpeg, int n) {
  for (size_t i = end_of_headers(jpeg); i + 1 < jpeg.size(); i++)
    if (jpeg[i] == 0xff && (jpeg[i + 1] & 0xf8) == 0xd0 && n-- == 0) return i + 1;
  return 0;
}

// 6 MCUs per row, one segment each: 4 segments, 3 markers.
TEST(Damage, LostSegmentsLoseOnlyTheirRows) {
  const auto whole = test::encode_jpeg(test::noisy_picture(96, 64, 1), {.restart_interval = 6});
  auto jpeg = whole;
  jpeg.erase(jpeg.begin() + static_cast<ptrdiff_t>(nth_restart(jpeg, 0)) + 1,
             jpeg.begin() + static_cast<ptrdiff_t>(nth_restart(jpeg, 1)) + 1);
  const auto frame = test::open_jpeg(jpeg);
  // Row 2 is between RST0 and RST2: it could also be row 1.
  EXPECT_TRUE(frame->ensure({0, 0, 96, 16}));
  EXPECT_FALSE(frame->ensure({0, 16, 96, 32}));
  EXPECT_FALSE(frame->ensure({0, 32, 96, 48}));
  EXPECT_TRUE(frame->ensure({0, 48, 96, 64}));
  const auto truth = test::open_jpeg(whole);
  ASSERT_TRUE(truth->ensure({0, 0, 96, 64}));
  for (int y = 48; y < 64; y++)
    EXPECT_EQ(std::memcmp(frame->view().plane[0] + y * 96, truth->view().plane[0] + y * 96, 96), 0) << y;
}

TEST(Damage, WrongRestartNumberLosesTheRest) {
  auto jpeg = test::encode_jpeg(test::noisy_picture(96, 64, 1), {.restart_interval = 6});
  jpeg[nth_restart(jpeg, 1)] = 0xd6;
  const auto frame = test::open_jpeg(jpeg);
  EXPECT_TRUE(frame->ensure({0, 0, 96, 32}));
  EXPECT_FALSE(frame->ensure({0, 32, 96, 48}));
  EXPECT_FALSE(frame->ensure({0, 48, 96, 64}));
}

TEST(Damage, MarkersAndEmptySegmentsInTheScan) {
  const auto whole = test::encode_jpeg(test::noisy_picture(96, 64, 1), {.restart_interval = 6});
  const auto at = static_cast<ptrdiff_t>(nth_restart(whole, 1));
  auto wrong_marker = whole;
  wrong_marker[static_cast<size_t>(at)] = 0xe3;
  EXPECT_FALSE(try_all(wrong_marker));
  {
    auto jpeg = whole;
    jpeg.erase(jpeg.begin() + static_cast<ptrdiff_t>(nth_restart(jpeg, 0)) + 1, jpeg.begin() + at - 1);
    const auto frame = test::open_jpeg(jpeg);
    EXPECT_FALSE(frame->ensure({0, 16, 96, 32}));
    EXPECT_TRUE(frame->ensure({0, 32, 96, 64}));
  }
  {
    auto jpeg = whole;
    jpeg.insert(jpeg.begin() + at - 1, 3, 0xff);
    EXPECT_TRUE(try_all(jpeg));
    jpeg.insert(jpeg.begin() + at - 1, 3, 0x12);
    EXPECT_FALSE(try_all(jpeg));
  }
  {
    auto jpeg = test::encode_jpeg(test::noisy_picture(96, 64, 1), {});
    const uint8_t marker[2] = {0xff, 0xd0};
    jpeg.insert(jpeg.begin() + static_cast<ptrdiff_t>(jpeg.size() / 2), marker, marker + 2);
    EXPECT_FALSE(try_all(jpeg));
  }
}

}  // namespace
}  // namespace lf
