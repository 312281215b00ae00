// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/sharpen.h"

#include <gtest/gtest.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace lf {
namespace {

Image noise(PixelFamily family, int width, int height) {
  Image image(family, width, height);
  std::mt19937 random(1);
  for (uint8_t& v : image.data()) v = static_cast<uint8_t>(random());
  return image;
}

double expected(const uint8_t* plane, int width, int height, int step, int x, int y) {
  const auto at = [&](int i, int j) {
    return static_cast<double>(plane[(std::clamp(j, 0, height - 1) * width + std::clamp(i, 0, width - 1)) * step]);
  };
  const double around = (at(x - 1, y) + at(x + 1, y) + at(x, y - 1) + at(x, y + 1)) / 4;
  return std::clamp(at(x, y) + kSharpening * (at(x, y) - around), 0., 255.);
}

TEST(Sharpen, IsTheDifferenceFromTheNeighbours) {
  for (const auto& [width, height] : {std::pair(83, 17), {1, 5}, {5, 1}, {2, 2}}) {
    const Image rgb = noise(PixelFamily::kRgb, width, height), i420 = noise(PixelFamily::kI420, width, height);
    ByteBuffer memory;
    ImageView sharp = sharpen(rgb.view(), {0, 0, width, height}, memory);
    for (int y = 0; y < height; y++)
      for (int x = 0; x < width; x++)
        for (int c = 0; c < 3; c++)
          EXPECT_NEAR(sharp.plane[0][3 * (y * width + x) + c], expected(rgb.data().data() + c, width, height, 3, x, y),
                      1.1)
              << x << ", " << y;
    const ImageView from = i420.view();
    sharp = sharpen(from, {0, 0, width, height}, memory);
    for (int c = 0; c < 3; c++) {
      const int w = c > 0 ? chroma_size(width) : width, h = c > 0 ? chroma_size(height) : height;
      for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++)
          EXPECT_NEAR(sharp.plane[c][y * sharp.stride[c] + x], expected(from.plane[c], w, h, 1, x, y), 1.1);
    }
  }
}

TEST(Sharpen, AnImageAsItIs) {
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420}) {
    const Image image = noise(family, 31, 17), sharp = sharpened(image);
    ByteBuffer memory;
    const ImageView view = sharpen(image.view(), {0, 0, 31, 17}, memory);
    EXPECT_EQ(sharp.family(), family);
    for (int c = 0; c < (family == PixelFamily::kRgb ? 1 : 3); c++) {
      const int rows = c > 0 ? chroma_size(17) : 17;
      EXPECT_TRUE(std::equal(view.plane[c], view.plane[c] + rows * view.stride[c], sharp.view().plane[c])) << c;
    }
  }
}

TEST(Sharpen, KeepsLayoutAndStride) {
  constexpr int kWidth = 21, kHeight = 9;
  const Image noisy = noise(PixelFamily::kRgb, 100, kHeight);  // 300 bytes a row, of which 84 are the image
  ImageView image = noisy.view();
  image.width = kWidth;
  image.layout = {4, 2, 1, 0};
  ByteBuffer memory;
  const ImageView sharp = sharpen(image, {0, 0, kWidth, kHeight}, memory);
  EXPECT_EQ(sharp.layout, image.layout);
  ASSERT_EQ(sharp.stride[0], 300);
  for (int y = 0; y < kHeight; y++)
    for (int x = 0; x < kWidth; x++) {
      const auto at = [&](int i, int j) {
        return image.plane[0][std::clamp(j, 0, kHeight - 1) * 300 + std::clamp(i, 0, kWidth - 1) * 4 + image.layout.r];
      };
      const double around = (at(x - 1, y) + at(x + 1, y) + at(x, y - 1) + at(x, y + 1)) / 4.;
      EXPECT_NEAR(sharp.plane[0][y * 300 + 4 * x + 2],
                  std::clamp(at(x, y) + kSharpening * (at(x, y) - around), 0., 255.), 1.1);
    }
}

// Sums in integers, as sharpen.cc has them for what lies at the border.
TEST(Sharpen, IsTheSameWithEveryInstructionSet) {
  for (const auto& [width, height] : {std::pair(130, 9), {83, 17}, {16, 3}, {3, 7}, {2, 1}}) {
    const Image image = noise(PixelFamily::kRgb, width, height);
    const auto at = [&](int x, int y, int c) {
      return static_cast<int>(*(image.pixel(std::clamp(x, 0, width - 1), std::clamp(y, 0, height - 1)) + c));
    };
    for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
      hwy::SetSupportedTargetsForTest(target);
      ByteBuffer memory;
      const ImageView sharp = sharpen(image.view(), {0, 0, width, height}, memory);
      for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++)
          for (int c = 0; c < 3; c++) {
            const int v = at(x, y, c);
            const int around = at(x - 1, y, c) + at(x + 1, y, c) + at(x, y - 1, c) + at(x, y + 1, c);
            EXPECT_EQ(sharp.plane[0][3 * (y * width + x) + c],
                      std::clamp(v + ((19 * (4 * v - around) + 128) >> 8), 0, 255))
                << hwy::TargetName(target) << ": " << x << ", " << y;
          }
      hwy::SetSupportedTargetsForTest(0);
    }
  }
}

TEST(Sharpen, TouchesOnlyWhatIsAskedFor) {
  const Image image = noise(PixelFamily::kI420, 32, 24);
  ByteBuffer whole, part(image.data().size());
  std::ranges::fill(part, 7);
  sharpen(image.view(), {0, 0, 32, 24}, whole);
  sharpen(image.view(), {8, 6, 20, 24}, part);
  for (int y = 0; y < 24; y++)
    for (int x = 0; x < 32; x++) {
      const bool inside = x >= 8 && x < 20 && y >= 6;
      EXPECT_EQ(part[y * 32 + x], inside ? whole[y * 32 + x] : 7);
    }
}

TEST(Sharpen, LeavesEvenColoursAlone) {
  Image image(PixelFamily::kRgb, 9, 9);
  std::ranges::fill(image.data(), 201);
  ByteBuffer memory;
  sharpen(image.view(), {0, 0, 9, 9}, memory);
  EXPECT_TRUE(std::ranges::equal(memory, image.data()));
}

}  // namespace
}  // namespace lf
