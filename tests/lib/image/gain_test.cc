// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/gain.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace lf {
namespace {

TEST(Gain, DividesLuma) {
  for (const float gain : {0.5f, 0.9f, 1.f, 1.1f, 2.f}) {
    std::vector<uint8_t> luma(256);
    std::iota(luma.begin(), luma.end(), 0);
    divide_by_gain(luma, gain);
    for (int v = 0; v < 256; v++) EXPECT_NEAR(luma[v], std::min(v / gain, 255.f), 0.6) << v << " / " << gain;
  }
}

TEST(Gain, LeavesBlackAndGreyAlone) {
  constexpr int kWidth = 22, kHeight = 6;
  Image image(PixelFamily::kI420, kWidth, kHeight);
  for (size_t i = 0; i < image.data().size(); i++) image.data()[i] = static_cast<uint8_t>(i * 37);
  std::fill_n(image.plane(1), 11, 128);
  const ImageView from = image.view();
  ByteBuffer memory;
  const ImageView out = divide_by_gain(from, {0, 0, kWidth, kHeight}, 0.8f, memory);
  for (int c = 0; c < 3; c++) {
    const int zero = c > 0 ? 128 : 0;
    for (int y = 0; y < (c > 0 ? kHeight / 2 : kHeight); y++)
      for (int x = 0; x < (c > 0 ? kWidth / 2 : kWidth); x++) {
        const int v = from.plane[c][y * from.stride[c] + x];
        const double expected = std::clamp((v - zero) / 0.8 + zero, 0., 255.);
        EXPECT_NEAR(out.plane[c][y * out.stride[c] + x], expected, 0.6) << c << ": " << x << ", " << y;
      }
  }
}

TEST(Gain, OfARectangleInAnyLayout) {
  constexpr int kWidth = 9, kHeight = 5;
  std::vector<uint8_t> pixels(4 * kWidth * kHeight);
  for (size_t i = 0; i < pixels.size(); i++) pixels[i] = static_cast<uint8_t>(i * 3);
  ImageView image{.family = PixelFamily::kRgb,
                  .width = kWidth,
                  .height = kHeight,
                  .layout = {4, 2, 1, 0},
                  .plane = {pixels.data()},
                  .stride = {4 * kWidth}};
  ByteBuffer memory(pixels.size(), 7);
  const ImageView out = divide_by_gain(image, {2, 1, 7, 4}, 1.25f, memory);
  EXPECT_EQ(out.layout, image.layout);
  for (int y = 0; y < kHeight; y++)
    for (int x = 0; x < kWidth; x++)
      for (int c = 0; c < 4; c++) {
        const size_t at = 4 * static_cast<size_t>(y * kWidth + x) + c;
        const bool inside = x >= 2 && x < 7 && y >= 1 && y < 4;
        EXPECT_NEAR(out.plane[0][at], inside ? pixels[at] / 1.25 : 7, 0.6);
      }
}

}  // namespace
}  // namespace lf
