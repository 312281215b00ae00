// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/resolve.h"

#include <gtest/gtest.h>

#include <vector>

namespace lf {
namespace {

// Accumulator's tests hold resolving against the rule in double precision; here is what only sums in somebody else's
// memory can have.

TEST(Resolve, StridesMayBeWiderThanThePicture) {
  const int w = 5, h = 3;
  std::vector<int16_t> samples(3 * 8 * h, 77 * 128);
  std::vector<uint16_t> lost(9 * h, 0xffff);
  ConstSumPlanes sums{.family = PixelFamily::kRgb, .rect = {0, 0, w, h}, .lost = lost.data(), .lost_stride = 9};
  for (int c = 0; c < 3; c++) {
    sums.plane[c] = &samples[8 * c];
    sums.stride[c] = 24;
  }
  for (int y = 0; y < h; y++)
    for (int x = 0; x < w; x++) {
      lost[9 * y + x] = y == 1 ? 16384 : 0;
      for (int c = 0; c < 3; c++) samples[24 * y + 8 * c + x] = static_cast<int16_t>(128 * (10 * y + x + 30 * c));
    }
  std::vector<uint8_t> out(w * h * 3);
  uint8_t* const plane[3] = {out.data()};
  const ptrdiff_t stride[3] = {w * 3};
  resolve(sums, nullptr, {}, {}, plane, stride);
  for (int y = 0; y < h; y++)
    for (int x = 0; x < w; x++)
      for (int c = 0; c < 3; c++) EXPECT_EQ(out[(y * w + x) * 3 + c], (10 * y + x + 30 * c) * (y == 1 ? 2 : 1));
}

TEST(Resolve, OneRowMayServeForAll) {
  const std::vector<int16_t> row = {128, 256, 384};
  ConstSumPlanes sums{.family = PixelFamily::kI420, .rect = {0, 0, 3, 4}};
  for (const int16_t*& plane : sums.plane) plane = row.data();
  std::vector<uint8_t> out(12 + 4 + 4);
  uint8_t* const plane[3] = {&out[0], &out[12], &out[16]};
  const ptrdiff_t stride[3] = {3, 2, 2};
  resolve(sums, nullptr, {}, {}, plane, stride);
  for (int y = 0; y < 4; y++) EXPECT_EQ(out[3 * y + 2], 3);
  EXPECT_EQ(out[12 + 3], 128 + 2);
}

TEST(Resolve, PixelsNobodyCoversAreBackgroundWithAndWithoutLostWeight) {
  const std::vector<int16_t> samples(3 * 4, 50 * 128);
  const std::vector<uint16_t> lost = {0, 16384, 32767, 40000};
  const uint8_t uncovered[4] = {1, 1, 0, 0};
  ConstSumPlanes sums =
      packed_sums<const int16_t, const uint16_t>(PixelFamily::kRgb, {0, 0, 4, 1}, samples.data(), lost.data());
  std::vector<uint8_t> out(16);
  uint8_t* const plane[3] = {out.data()};
  const ptrdiff_t stride[3] = {16};
  const auto red = [&](int x) { return out[4 * x]; };
  resolve(sums, uncovered, {9, 8, 7}, {4, 0, 1, 2}, plane, stride);
  for (int x = 0; x < 4; x++) EXPECT_EQ(red(x), 9);
  resolve(sums, nullptr, {9, 8, 7}, {4, 0, 1, 2}, plane, stride);
  EXPECT_EQ(red(0), 50);
  EXPECT_EQ(red(1), 100);
  EXPECT_EQ(red(2), 9);  // too little left to be scaled
  EXPECT_EQ(out[4 * 3 + 3], 255);
  sums.lost = nullptr;
  resolve(sums, uncovered, {9, 8, 7}, {4, 0, 1, 2}, plane, stride);
  EXPECT_EQ(red(1), 9);
  EXPECT_EQ(red(2), 50);
}

}  // namespace
}  // namespace lf
