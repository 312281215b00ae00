// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/jpeg_frame.h"

#include <algorithm>
#include <atomic>
#include <random>
#include <thread>

#include <gtest/gtest.h>

#include "jpeg/full_decode.h"
#include "support/jpeg_samples.h"

namespace lf {
namespace {

using test::JpegKind;

// Whether the region of the frame is what libjpeg makes of it, chroma samples of all its pixels included.
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
                 << "plane " << i << " (" << x << ", " << y << "): " << a << " in place of " << b;
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

// On frames that nothing is known of, and one after the other on the same frame.
TEST_P(EveryKind, RegionsAreWhatLibjpegDecodes) {
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
        ASSERT_TRUE(shared);
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
                                         // As FFmpeg states 4:2:2.
                                         Case{"yuv422_as_2212", {.chroma_v = 2}},
                                         Case{"grey", {.grey = true, .h = 1, .v = 1}},
                                         Case{"own_tables", {.optimise = true}}),
                         [](const auto& info) { return info.param.name; });

class WholeFrames : public testing::TestWithParam<Case> {};

TEST_P(WholeFrames, AreWhatLibjpegDecodes) {
  for (const auto& [width, height] : {std::pair{160, 96}, {51, 33}, {1, 1}}) {
    const auto jpeg = test::encode_jpeg(test::noisy_picture(width, height, 4), GetParam().kind);
    const Image truth = test::to_i420(test::decode_raw(jpeg));
    const auto frame = test::open_jpeg(jpeg);
    ASSERT_TRUE(frame);
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

// Whatever the version of its JFIF marker.
TEST(JpegFrame, RgbIsConverted) {
  const auto jpeg = test::encode_jpeg(test::noisy_picture(40, 24, 5), {.h = 1, .v = 1, .rgb = true});
  const auto frame = test::open_jpeg(jpeg);
  ASSERT_TRUE(frame);
  ASSERT_TRUE(frame->ensure({3, 3, 9, 9}));
  const std::optional<Image> rgb = jpeg::decode_rgb(jpeg, nullptr);
  ASSERT_TRUE(rgb);
  EXPECT_TRUE(equal_inside({0, 0, 40, 24}, frame->view(), to_i420(*rgb)));
}

TEST(JpegFrame, VersionsThatNobodyKnowsAreNoDamage) {
  for (const bool progressive : {false, true}) {
    auto jpeg = test::encode_jpeg(test::noisy_picture(51, 33, 4), {.progressive = progressive});
    const Image truth = test::to_i420(test::decode_raw(jpeg));
    ASSERT_EQ(jpeg[6], 'J');
    jpeg[11] = 9;
    const auto frame = test::open_jpeg(jpeg);
    ASSERT_TRUE(frame);
    std::string reason;
    ASSERT_TRUE(frame->ensure({0, 0, 51, 33}, &reason)) << reason;
    EXPECT_TRUE(equal_inside({0, 0, 51, 33}, frame->view(), truth));
  }
}

TEST(JpegFrame, DecodesSamplingBeyondHalfResolution) {
  const auto jpeg = test::encode_jpeg(test::noisy_picture(100, 60, 4), {.h = 4, .v = 1});
  const auto frame = test::open_jpeg(jpeg);
  ASSERT_TRUE(frame);
  ASSERT_TRUE(frame->ensure({0, 0, 100, 60}));
  const test::RawPlanes raw = test::decode_raw(jpeg);
  const ImageView view = frame->view();
  for (int y = 0; y < 30; y++)
    for (int x = 0; x < 50; x++) {
      const auto at = [&](int v) { return raw.planes[1].samples[(2 * y + v) * raw.planes[1].stride + x / 2]; };
      ASSERT_EQ(view.plane[1][y * view.stride[1] + x], (at(0) + at(1) + 1) / 2);
    }
}

TEST(JpegFrame, MissingHuffmanTablesAreTheStandardOnes) {
  const auto whole = test::encode_jpeg(test::noisy_picture(100, 60, 4), {});
  const auto bare = test::without_huffman_tables(whole);
  ASSERT_LT(bare.size(), whole.size() - 400);
  const auto frame = test::open_jpeg(bare);
  ASSERT_TRUE(frame);
  ASSERT_TRUE(frame->ensure({30, 20, 80, 50}));
  EXPECT_TRUE(equal_inside({30, 20, 80, 50}, frame->view(), test::to_i420(test::decode_raw(whole))));
}

TEST(JpegFrame, PlanesAreThereFromTheFirstRegionOn) {
  const auto frame = test::open_jpeg(test::encode_jpeg(test::noisy_picture(100, 61, 4), {}));
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->width(), 100);
  EXPECT_EQ(frame->height(), 61);
  EXPECT_EQ(frame->view().plane[0], nullptr);
  EXPECT_TRUE(frame->ensure({5, 5, 5, 9}));
  EXPECT_TRUE(frame->ensure({100, 0, 200, 10}));
  EXPECT_EQ(frame->view().plane[0], nullptr) << "nothing was asked for";
  EXPECT_TRUE(frame->ensure({-100, -100, 1, 1}));
  const ImageView view = frame->view();
  EXPECT_NE(view.plane[0], nullptr);
  EXPECT_TRUE(frame->ensure({0, 0, 1000, 1000}));
  EXPECT_EQ(frame->view().plane[2], view.plane[2]);
  EXPECT_EQ(view.family, PixelFamily::kI420);
  EXPECT_EQ(view.width, 100);
  EXPECT_EQ(view.height, 61);
}

// The largest width; the memory of what nobody looks at is not touched.
TEST(JpegFrame, WideFrames) {
  const auto jpeg = test::encode_jpeg(test::noisy_picture(16384, 33, 6), {.restart_interval = 100});
  const Image truth = test::to_i420(test::decode_raw(jpeg));
  const auto frame = test::open_jpeg(jpeg);
  ASSERT_TRUE(frame);
  for (const Rect& region : {Rect{16000, 30, 16384, 33}, {5000, 0, 5001, 33}, {7000, 15, 9000, 17}}) {
    ASSERT_TRUE(frame->ensure(region));
    EXPECT_TRUE(equal_inside(region, frame->view(), truth));
  }
}

TEST(JpegFrame, ViewsMayShareIt) {
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

}  // namespace
}  // namespace lf
