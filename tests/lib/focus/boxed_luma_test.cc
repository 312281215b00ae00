// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/boxed_luma.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "lib/focus/every_target.h"
#include "reference/generators.h"

namespace lf {
namespace {

// Against the mean of the rounded luma of sixteen pixels, repeated at the border.
void expect_boxes_here(const ImageView& image, const std::vector<int>& luma, const Rect& rect) {
  BoxedLuma out;
  box_luma(image, rect, out);
  ASSERT_EQ(out.rect, rect);
  ASSERT_EQ(out.values.size(), static_cast<size_t>(rect.width()) * rect.height() + BoxedLuma::kSpare);
  const auto mean = [&](int x, int y) {
    int sum = 0;
    for (int j = y - 1; j <= y + 2; j++)
      for (int i = x - 1; i <= x + 2; i++)
        sum += luma[std::clamp(j, 0, image.height - 1) * image.width + std::clamp(i, 0, image.width - 1)];
    return (sum + 8) / 16;
  };
  for (int y = rect.y0; y < rect.y1; y++)
    for (int x = rect.x0; x < rect.x1; x++) {
      const int both = out.values[(y - rect.y0) * rect.width() + x - rect.x0];
      EXPECT_EQ(both & 255, mean(x, y)) << x << ", " << y;
      if (y + 1 < image.height) {
        EXPECT_EQ(both >> 8, mean(x, y + 1)) << x << ", " << y << ", below";
      }
    }
}

void expect_boxes(const ImageView& image, const std::vector<int>& luma, const Rect& rect) {
  test::on_every_target([&] { expect_boxes_here(image, luma, rect); });
}

TEST(BoxedLuma, IsTheMeanOfSixteenPixelsOfAnyLayout) {
  reference::Random random(3);
  for (const RgbLayout& layout : {RgbLayout{3, 0, 1, 2}, RgbLayout{3, 2, 1, 0}, RgbLayout{4, 1, 2, 3},
                                  RgbLayout{4, 2, 1, 0}, RgbLayout{6, 0, 2, 4}})
    for (const auto& [width, height] : {std::pair{70, 9}, {33, 40}, {3, 2}, {1, 1}}) {
      std::vector<uint8_t> pixels(static_cast<size_t>(width) * height * layout.pixel_stride);
      for (uint8_t& value : pixels) value = static_cast<uint8_t>(random.uniform(0, 256));
      std::vector<int> luma;
      for (size_t i = 0; i < pixels.size(); i += layout.pixel_stride)
        luma.push_back((77 * pixels[i + layout.r] + 150 * pixels[i + layout.g] + 29 * pixels[i + layout.b] + 128) >> 8);
      const ImageView image{.family = PixelFamily::kRgb,
                            .width = width,
                            .height = height,
                            .layout = layout,
                            .plane = {pixels.data()},
                            .stride = {ptrdiff_t{width} * layout.pixel_stride}};
      SCOPED_TRACE(std::to_string(layout.pixel_stride) + " bytes a pixel, " + std::to_string(width) + "x" +
                   std::to_string(height));
      expect_boxes(image, luma, {0, 0, width, height});
      if (width > 8) {
        expect_boxes(image, luma, {2, 1, width - 1, height - 3});
        expect_boxes(image, luma, {5, 0, width - 3, height - 1});
        expect_boxes(image, luma, {0, height - 1, 3, height});
      }
    }
}

TEST(BoxedLuma, OfYCbCrIsOfItsLuma) {
  reference::Random random(4);
  Image image(PixelFamily::kI420, 38, 12);
  for (uint8_t& value : image.data()) value = static_cast<uint8_t>(random.uniform(0, 256));
  const std::vector<int> luma(image.data().begin(), image.data().begin() + 38 * 12);
  expect_boxes(image.view(), luma, {0, 0, 38, 12});
  expect_boxes(image.view(), luma, {4, 4, 30, 12});
}

}  // namespace
}  // namespace lf
