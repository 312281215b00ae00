// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/hypothesis_samples.h"

#include "focus/photo_consistency.h"
#include "lib/focus/random_rays.h"
#include "reference/generators.h"
#include "support/every_target.h"
#include "support/test.h"

namespace lf {
namespace {

// Compares with the mean of the rounded luma of sixteen pixels, clamped at the border.
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

TEST(BoxedLuma, UsesTheLumaOfYCbCr) {
  reference::Random random(4);
  Image image(PixelFamily::kI420, 38, 12);
  for (uint8_t& value : image.data()) value = static_cast<uint8_t>(random.uniform(0, 256));
  const std::vector<int> luma(image.data().begin(), image.data().begin() + 38 * 12);
  expect_boxes(image.view(), luma, {0, 0, 38, 12});
  expect_boxes(image.view(), luma, {4, 4, 30, 12});
}

// Compares with the mean of all pixels of a box: each doubling rounds once, by at most half a level.
TEST(BoxedLuma, LargerBoxesAreMeansOfTheirPixels) {
  reference::Random random(6);
  for (const auto& [width, height] : {std::pair{70, 50}, {33, 40}, {9, 70}, {3, 2}, {1, 1}}) {
    Image image(PixelFamily::kI420, width + width % 2, height + height % 2);
    for (uint8_t& value : image.data()) value = static_cast<uint8_t>(random.uniform(0, 256));
    const int w = image.view().width, h = image.view().height;
    for (int box = kHypothesisBox, rounds = 0; box <= kMaxHypothesisBox; box *= 2, rounds++)
      for (const Rect& rect : {Rect{0, 0, w, h}, Rect{w / 2, h / 3, w, h}, Rect{w / 3, h / 2, w / 3 + 1, h / 2 + 1}}) {
        SCOPED_TRACE(std::to_string(w) + "x" + std::to_string(h) + ", boxes of " + std::to_string(box));
        test::on_every_target([&] {
          BoxedLuma out;
          box_luma(image.view(), rect, out, box);
          ASSERT_EQ(out.rect, rect);
          ASSERT_EQ(out.values.size(), static_cast<size_t>(rect.width()) * rect.height() + BoxedLuma::kSpare);
          const auto mean = [&](int x, int y) {
            double sum = 0;
            for (int j = y - box / 2 + 1; j <= y + box / 2; j++)
              for (int i = x - box / 2 + 1; i <= x + box / 2; i++)
                sum += image.data()[std::clamp(j, 0, h - 1) * w + std::clamp(i, 0, w - 1)];
            return sum / box / box;
          };
          for (int y = rect.y0; y < rect.y1; y++)
            for (int x = rect.x0; x < rect.x1; x++) {
              const int both = out.values[(y - rect.y0) * rect.width() + x - rect.x0];
              EXPECT_NEAR(both & 255, mean(x, y), 0.5 * (rounds + 1)) << x << ", " << y;
              if (y + 1 < h) {
                EXPECT_NEAR(both >> 8, mean(x, y + 1), 0.5 * (rounds + 1)) << x << ", " << y << ", below";
              }
            }
        });
      }
  }
}

using test::RandomRays;

// Positions of project_hypothesis(), sampled one by one from the luma of the whole image, give identical values for any
// number of nodes.
TEST(HypothesisSamples, EqualSamplesOfTheWholeImage) {
  reference::Random random(5);
  Image image(PixelFamily::kI420, RandomRays::kWidth, RandomRays::kHeight);
  for (uint8_t& value : image.data()) value = static_cast<uint8_t>(random.uniform(0, 256));
  BoxedLuma boxed;
  box_luma(image.view(), {0, 0, RandomRays::kWidth, RandomRays::kHeight}, boxed);
  size_t seen_at_all = 0;
  for (int count = 1; count < 70; count++) {
    const RandomRays rays(random, count);
    ByteBuffer levels(rays.levels.begin(), rays.levels.end());
    levels.resize(2 * rays.levels.size(), 130);
    RandomRays second = rays;
    std::ranges::fill(second.levels, 130);
    test::on_every_target([&] {
      const HypothesisValues values = sample_hypotheses(rays.projection, rays.rays(), levels, image.view());
      ASSERT_EQ(values.size(), levels.size());
      for (size_t t = 0; t < 2; t++) {
        const std::vector<test::Position> positions = (t == 0 ? rays : second).positions();
        for (int i = 0; i < count; i++) {
          int value = -1;
          if (positions[i].seen) {
            const int fx = test::in_256ths(positions[i].x, RandomRays::kWidth);
            const int fy = test::in_256ths(positions[i].y, RandomRays::kHeight);
            const auto at = [&](int dx, int dy) {
              const int x = std::min((fx >> 8) + dx, RandomRays::kWidth - 1);
              const int y = std::min((fy >> 8) + dy, RandomRays::kHeight - 1);
              return boxed.values[y * RandomRays::kWidth + x] & 255;
            };
            const int ax = fx & 255, ay = fy & 255;
            const int upper = at(0, 0) * (256 - ax) + at(1, 0) * ax, lower = at(0, 1) * (256 - ax) + at(1, 1) * ax;
            value = (upper * (256 - ay) + lower * ay + (1 << 15)) >> 16;
            seen_at_all++;
          }
          EXPECT_EQ(values[t * rays.levels.size() + i], value) << count << ", " << i;
        }
      }
    });
  }
  EXPECT_GT(seen_at_all, 500u);
}

TEST(HypothesisSamples, EmptyInputIsAccepted) {
  reference::Random random(6);
  RandomRays rays(random, 20);
  rays.projection.cx = -1e6f;
  const Image image(PixelFamily::kRgb, RandomRays::kWidth, RandomRays::kHeight);
  const ByteBuffer levels(rays.levels.begin(), rays.levels.end());
  const HypothesisValues values = sample_hypotheses(rays.projection, rays.rays(), levels, image.view());
  for (int i = 0; i < 20; i++) EXPECT_EQ(values[i], -1);
}

TEST(HypothesisSamples, AreAddedLikePhotoConsistencySums) {
  reference::Random random(8);
  for (int count = 1; count < 70; count++) {
    const RandomRays rays(random, count);
    std::vector<int16_t> values(count + kHypothesisPadding);
    for (int i = 0; i < count; i++) values[i] = static_cast<int16_t>(i % 7 == 3 ? -1 : random.uniform(0, 256));
    // A map that continues for 3 nodes, in two rows.
    const int columns = count + 2, x0 = count / 3;
    const std::vector<HypothesisRow> rows{{0, x0, count, 0}, {1, 0, x0, count - x0}};
    std::vector<uint16_t> begun(static_cast<size_t>(columns + x0 + 3));
    for (uint16_t& sum : begun) sum = static_cast<uint16_t>(random.uniform(0, 65536));
    test::on_every_target([&] {
      std::vector<uint16_t> weight(count + kHypothesisPadding), luma(weight), square(weight);
      std::vector<uint16_t> weights(begun), lumas(begun), squares(begun);
      const HypothesisSums more{weight.data(), luma.data(), square.data()};
      weigh_hypothesis(rays.weight.data(), values.data(), count, more);
      add_rows(rows, more, columns, begun.size(), {weights.data(), lumas.data(), squares.data()});
      std::vector<int> expected[3];
      for (std::vector<int>& sums : expected) sums.assign(begun.begin(), begun.end());
      for (int i = 0; i < count; i++) {
        const float w = values[i] < 0 ? 0 : rays.weight[i];
        const auto value = static_cast<float>(values[i]), weighted = w * value;
        EXPECT_EQ(weight[i], static_cast<int>(w * PhotoConsistency::kWeightOne + 0.5f));
        // Luma and square follow from the rounded weight, and are close to the values for the unrounded weight.
        EXPECT_EQ(luma[i], PhotoConsistency::luma_of(weight[i], std::max<int>(values[i], 0)));
        EXPECT_EQ(square[i], PhotoConsistency::square_of(luma[i], std::max<int>(values[i], 0)));
        EXPECT_NEAR(luma[i], weighted * PhotoConsistency::kLumaOne, 1);
        EXPECT_NEAR(square[i], weighted * value, 2.5);
        const int node = i < count - x0 ? x0 + i : columns + i - (count - x0);
        const int added[3] = {weight[i], luma[i], square[i]};
        for (int k = 0; k < 3; k++) expected[k][node] = std::min(expected[k][node] + added[k], 65535);
      }
      EXPECT_TRUE(std::ranges::equal(weights, expected[0]));
      EXPECT_TRUE(std::ranges::equal(lumas, expected[1]));
      EXPECT_TRUE(std::ranges::equal(squares, expected[2]));
    });
  }
}

}  // namespace

}  // namespace lf
