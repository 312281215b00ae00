// SPDX-License-Identifier: LGPL-2.1-or-later
// Frames that arrive damaged: errors, never crashes. Run it under sanitizers (tests/sanitize.sh address jpeg).
#include <cstring>
#include <random>

#include <gtest/gtest.h>

#include "jpeg/jpeg_frame.h"
#include "support/jpeg_samples.h"

namespace lf {
namespace {

using test::JpegKind;

const JpegKind kKinds[] = {{},
                           {.restart_interval = 5},
                           {.v = 1, .restart_interval = 1},
                           {.h = 1, .v = 1, .optimise = true},
                           {.grey = true, .h = 1, .v = 1, .restart_interval = 12},
                           {.progressive = true},
                           {.one_by_one = true}};

// Asks for a few regions, then for all. Whether all could be had.
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

TEST(Damage, WhatPrecedesTheCutIsStillThere) {
  for (const int interval : {0, 6}) {
    const auto jpeg = test::encode_jpeg(test::noisy_picture(96, 64, 1), {.restart_interval = interval});
    const auto frame = test::open_jpeg({jpeg.begin(), jpeg.begin() + static_cast<ptrdiff_t>(jpeg.size() * 2 / 3)});
    ASSERT_TRUE(frame);
    EXPECT_TRUE(frame->ensure({0, 0, 96, 16}));
    std::string reason;
    EXPECT_FALSE(frame->ensure({0, 0, 96, 64}, &reason));
    EXPECT_EQ(reason.rfind("damaged in row ", 0), 0u) << reason;
    EXPECT_TRUE(frame->ensure({20, 0, 96, 16}));
  }
}

TEST(Damage, MissingEndOfImageIsNone) {
  for (const int interval : {0, 5}) {
    auto jpeg = test::encode_jpeg(test::noisy_picture(96, 64, 1), {.restart_interval = interval});
    jpeg.resize(jpeg.size() - 2);
    EXPECT_TRUE(try_all(jpeg));
    jpeg.insert(jpeg.end(), 100, 0);  // padding, as of a fixed transfer size
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
      // In headers as often as in what they are about, though they are short.
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

// Ones and zeros alone: the longest codes, the shortest ones, no end.
TEST(Damage, ConstantBytesInPlaceOfTheScan) {
  for (const JpegKind& kind : kKinds)
    for (const int value : {0x00, 0x01, 0x55, 0xaa, 0xfe, 0xff}) {
      auto jpeg = test::encode_jpeg(test::noisy_picture(96, 64, 2), kind);
      std::fill(jpeg.begin() + static_cast<ptrdiff_t>(end_of_headers(jpeg)), jpeg.end(), static_cast<uint8_t>(value));
      try_all(jpeg);
    }
}

// The n-th restart marker's number, or a byte between markers.
size_t nth_restart(const std::vector<uint8_t>& jpeg, int n) {
  for (size_t i = end_of_headers(jpeg); i + 1 < jpeg.size(); i++)
    if (jpeg[i] == 0xff && (jpeg[i + 1] & 0xf8) == 0xd0 && n-- == 0) return i + 1;
  return 0;
}

// 6 MCUs a row, one segment each: 4 segments, 3 markers.
TEST(Damage, LostSegmentsLoseTheirRowsAlone) {
  const auto whole = test::encode_jpeg(test::noisy_picture(96, 64, 1), {.restart_interval = 6});
  auto jpeg = whole;
  jpeg.erase(jpeg.begin() + static_cast<ptrdiff_t>(nth_restart(jpeg, 0)) + 1,
             jpeg.begin() + static_cast<ptrdiff_t>(nth_restart(jpeg, 1)) + 1);
  const auto frame = test::open_jpeg(jpeg);
  ASSERT_TRUE(frame);
  // Row 2 stands between RST0 and RST2: it could be row 1 as well.
  EXPECT_TRUE(frame->ensure({0, 0, 96, 16}));
  EXPECT_FALSE(frame->ensure({0, 16, 96, 32}));
  EXPECT_FALSE(frame->ensure({0, 32, 96, 48}));
  EXPECT_TRUE(frame->ensure({0, 48, 96, 64}));
  const auto truth = test::open_jpeg(whole);
  ASSERT_TRUE(truth->ensure({0, 0, 96, 64}));
  for (int y = 48; y < 64; y++)
    EXPECT_EQ(std::memcmp(frame->view().plane[0] + y * 96, truth->view().plane[0] + y * 96, 96), 0) << y;
}

TEST(Damage, AWrongRestartNumberLosesTheRest) {
  auto jpeg = test::encode_jpeg(test::noisy_picture(96, 64, 1), {.restart_interval = 6});
  jpeg[nth_restart(jpeg, 1)] = 0xd6;
  const auto frame = test::open_jpeg(jpeg);
  ASSERT_TRUE(frame);
  EXPECT_TRUE(frame->ensure({0, 0, 96, 32}));
  EXPECT_FALSE(frame->ensure({0, 32, 96, 48}));
  EXPECT_FALSE(frame->ensure({0, 48, 96, 64}));
}

TEST(Damage, MarkersAndEmptySegmentsInTheScan) {
  const auto whole = test::encode_jpeg(test::noisy_picture(96, 64, 1), {.restart_interval = 6});
  const auto at = static_cast<ptrdiff_t>(nth_restart(whole, 1));
  {
    auto jpeg = whole;
    jpeg[static_cast<size_t>(at)] = 0xe3;  // another marker
    EXPECT_FALSE(try_all(jpeg));
  }
  {
    auto jpeg = whole;
    jpeg.erase(jpeg.begin() + static_cast<ptrdiff_t>(nth_restart(jpeg, 0)) + 1, jpeg.begin() + at - 1);
    const auto frame = test::open_jpeg(jpeg);
    ASSERT_TRUE(frame);
    EXPECT_FALSE(frame->ensure({0, 16, 96, 32}));
    EXPECT_TRUE(frame->ensure({0, 32, 96, 64}));
  }
  {
    auto jpeg = whole;
    jpeg.insert(jpeg.begin() + at - 1, 3, 0xff);  // fill bytes are allowed before markers
    EXPECT_TRUE(try_all(jpeg));
    jpeg.insert(jpeg.begin() + at - 1, 3, 0x12);  // others are not
    EXPECT_FALSE(try_all(jpeg));
  }
  {
    // Restart markers without a restart interval.
    auto jpeg = test::encode_jpeg(test::noisy_picture(96, 64, 1), {});
    const uint8_t marker[2] = {0xff, 0xd0};
    jpeg.insert(jpeg.begin() + static_cast<ptrdiff_t>(jpeg.size() / 2), marker, marker + 2);
    EXPECT_FALSE(try_all(jpeg));
  }
}

}  // namespace
}  // namespace lf
