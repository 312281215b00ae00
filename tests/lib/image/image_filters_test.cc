// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/image_filters.h"
#include "support/every_target.h"
#include "support/test.h"

namespace lf {
namespace {

TEST(ImageCopy, InterleavedColoursAreOnePlane) {
  std::vector<uint8_t> pixels(5 * 40);
  ImageView image{PixelFamily::kRgb, 7, 5, {4, 2, 1, 0}, {pixels.data()}, {40}};
  ByteBuffer memory;
  int planes = 0;
  const ImageView copy = write_copy(image, {1, 2, 6, 5}, memory, [&](const PlaneCopy& plane) {
    planes++;
    EXPECT_EQ(plane.from, pixels.data());
    EXPECT_EQ(plane.to, memory.data());
    EXPECT_EQ(plane.stride, 40);
    EXPECT_EQ(plane.step, 4);
    EXPECT_EQ(plane.width, 7);
    EXPECT_EQ(plane.height, 5);
    EXPECT_EQ(plane.part, (Rect{1, 2, 6, 5}));
    EXPECT_EQ(plane.index, 0);
  });
  EXPECT_EQ(planes, 1);
  EXPECT_EQ(memory.size(), 200u);
  EXPECT_EQ(copy.plane[0], memory.data());
  EXPECT_EQ(copy.stride[0], 40);
  EXPECT_EQ(copy.layout, image.layout);
}

TEST(ImageCopy, CoversSubsampledPlanes) {
  const Image odd(PixelFamily::kI420, 7, 5);
  const ImageView image = odd.view();
  ByteBuffer memory;
  std::vector<PlaneCopy> planes;
  const ImageView copy =
      write_copy(image, {2, 2, 7, 5}, memory, [&](const PlaneCopy& plane) { planes.push_back(plane); });
  ASSERT_EQ(planes.size(), 3u);
  EXPECT_EQ(memory.size(), 7u * 5 + 2 * 4 * 3);
  for (int c = 0; c < 3; c++) {
    EXPECT_EQ(planes[c].index, c);
    EXPECT_EQ(planes[c].from, image.plane[c]);
    EXPECT_EQ(planes[c].to, copy.plane[c]);
    EXPECT_EQ(planes[c].step, 1);
    EXPECT_EQ(planes[c].width, c == 0 ? 7 : 4);
    EXPECT_EQ(planes[c].height, c == 0 ? 5 : 3);
    EXPECT_EQ(planes[c].part, c == 0 ? (Rect{2, 2, 7, 5}) : (Rect{1, 1, 4, 3}));
    EXPECT_EQ(copy.plane[c] - memory.data(), image.plane[c] - image.plane[0]);
  }
}

TEST(ImageCopy, KeepsUnwrittenPixels) {
  const Image grey(PixelFamily::kRgb, 4, 4);
  ByteBuffer memory(4 * 4 * 3, 9);
  write_copy(grey.view(), {0, 1, 4, 2}, memory, [](const PlaneCopy& plane) {
    std::memset(plane.to + plane.part.y0 * plane.stride, 1, plane.part.width() * plane.step);
  });
  for (size_t i = 0; i < memory.size(); i++) EXPECT_EQ(memory[i], i / 12 == 1 ? 1 : 9);
}

TEST(Gain, DividesLuma) {
  for (const float gain : {0.5f, 0.9f, 1.f, 1.1f, 2.f}) {
    std::vector<uint8_t> luma(256);
    std::iota(luma.begin(), luma.end(), 0);
    divide_by_gain(luma, gain);
    for (int v = 0; v < 256; v++) EXPECT_NEAR(luma[v], std::min(v / gain, 255.f), 0.6) << v << " / " << gain;
  }
}

TEST(Gain, KeepsBlackAndNeutralChroma) {
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

TEST(Gain, AppliesToARectangleInAnyLayout) {
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

Image noise(PixelFamily family, int width, int height) {
  Image image(family, width, height);
  std::mt19937 random(1);
  for (uint8_t& v : image.data()) v = static_cast<uint8_t>(random());
  return image;
}

double expected(const uint8_t* plane, int width, int height, int step, int x, int y, ptrdiff_t stride = 0) {
  if (stride == 0) stride = ptrdiff_t{width} * step;
  const auto at = [&](int i, int j) {
    return static_cast<double>(plane[std::clamp(j, 0, height - 1) * stride + std::clamp(i, 0, width - 1) * step]);
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

TEST(Sharpen, SharpensARealImage) {
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
  const Image noisy = noise(PixelFamily::kRgb, 100, kHeight);  // stride of 300 bytes with 84 bytes of image
  ImageView image = noisy.view();
  image.width = kWidth;
  image.layout = {4, 2, 1, 0};
  ByteBuffer memory;
  const ImageView sharp = sharpen(image, {0, 0, kWidth, kHeight}, memory);
  EXPECT_EQ(sharp.layout, image.layout);
  ASSERT_EQ(sharp.stride[0], 300);
  for (int y = 0; y < kHeight; y++)
    for (int x = 0; x < kWidth; x++)
      EXPECT_NEAR(sharp.plane[0][y * 300 + 4 * x + 2],
                  expected(image.plane[0] + image.layout.r, kWidth, kHeight, 4, x, y, 300), 1.1);
}

TEST(Sharpen, IsTheSameWithEveryInstructionSet) {
  for (const auto& [width, height] : {std::pair(130, 9), {83, 17}, {16, 3}, {3, 7}, {2, 1}}) {
    const Image image = noise(PixelFamily::kRgb, width, height);
    const auto at = [&](int x, int y, int c) {
      return static_cast<int>(*(image.pixel(std::clamp(x, 0, width - 1), std::clamp(y, 0, height - 1)) + c));
    };
    test::on_every_target([&, width = width, height = height] {
      ByteBuffer memory;
      const ImageView sharp = sharpen(image.view(), {0, 0, width, height}, memory);
      for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++)
          for (int c = 0; c < 3; c++) {
            const int v = at(x, y, c);
            const int around = at(x - 1, y, c) + at(x + 1, y, c) + at(x, y - 1, c) + at(x, y + 1, c);
            EXPECT_EQ(sharp.plane[0][3 * (y * width + x) + c],
                      std::clamp(v + ((19 * (4 * v - around) + 128) >> 8), 0, 255))
                << x << ", " << y;
          }
    });
  }
}

TEST(Sharpen, ChangesOnlyTheRectangle) {
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

TEST(Sharpen, KeepsUniformColours) {
  Image image(PixelFamily::kRgb, 9, 9);
  std::ranges::fill(image.data(), 201);
  ByteBuffer memory;
  sharpen(image.view(), {0, 0, 9, 9}, memory);
  EXPECT_TRUE(std::ranges::equal(memory, image.data()));
}

}  // namespace
}  // namespace lf
