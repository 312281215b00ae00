// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/resolve.h"
#include "composite/accumulator.h"
#include "render/sum_planes.h"
#include "support/fragments.h"
#include "support/test.h"

namespace lf {
namespace {

// accumulator_test.cc compares resolving with the rule in double precision; these tests cover sums in external memory.

TEST(Resolve, StridesMayBeWiderThanThePicture) {
  const int w = 5, h = 3;
  std::vector<int16_t> samples(3 * 8 * h, 77 * 128);
  std::vector<uint16_t> lost(9 * h, 0xffff);
  ConstSumPlanes sums{.family = PixelFamily::kRgb, .rect = {0, 0, w, h}, .lost = lost.data(), .missing_stride = 9};
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

TEST(Resolve, RowsMayBeShared) {
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

TEST(Resolve, InterleavedChromaEqualsPlanes) {
  for (const auto& [w, h] : {std::pair{9, 5}, {8, 6}, {1, 1}, {2, 4}, {130, 4}}) {
    const size_t pixels = static_cast<size_t>(w) * h, cw = chroma_size(w), ch = chroma_size(h);
    std::vector<int16_t> samples(pixels + 2 * cw * ch);
    for (size_t i = 0; i < samples.size(); i++) samples[i] = static_cast<int16_t>((i * 7919) % 20000 - 8000);
    std::vector<uint16_t> lost(pixels);
    std::vector<uint8_t> uncovered(pixels);
    for (size_t i = 0; i < pixels; i++) {
      lost[i] = i % w > 2 && i > pixels / 2 ? static_cast<uint16_t>((i * 331) % 32768) : 0;
      uncovered[i] = i > pixels / 2 && i % 5 == 0;
    }
    const ConstSumPlanes sums =
        packed_sums<const int16_t, const uint16_t>(PixelFamily::kI420, {0, 0, w, h}, samples.data(), lost.data());
    std::vector<uint8_t> planar(pixels + 2 * cw * ch);
    uint8_t* const planes[3] = {planar.data(), &planar[pixels], &planar[pixels + cw * ch]};
    const ptrdiff_t strides[3] = {w, static_cast<ptrdiff_t>(cw), static_cast<ptrdiff_t>(cw)};
    resolve(sums, uncovered.data(), {200, 30, 90}, {}, planes, strides);
    const size_t wide = 2 * cw + 3;
    std::vector<uint8_t> luma(pixels), chroma(wide * ch, 77);
    uint8_t* const both[3] = {luma.data(), chroma.data(), chroma.data() + 1};
    const ptrdiff_t wider[3] = {w, static_cast<ptrdiff_t>(wide), static_cast<ptrdiff_t>(wide)};
    resolve(sums, uncovered.data(), {200, 30, 90}, {}, both, wider);
    EXPECT_TRUE(std::equal(luma.begin(), luma.end(), planar.begin()));
    for (size_t y = 0; y < ch; y++) {
      for (size_t x = 0; x < cw; x++) {
        ASSERT_EQ(chroma[y * wide + 2 * x], planes[1][y * cw + x]) << w << "x" << h << ": " << x << ", " << y;
        ASSERT_EQ(chroma[y * wide + 2 * x + 1], planes[2][y * cw + x]);
      }
      for (size_t x = 2 * cw; x < wide; x++) ASSERT_EQ(chroma[y * wide + x], 77) << "beyond the picture";
    }
  }
}

struct Patchy {
  Patchy(int w, int h) : w(w), h(h), samples(packed_size(PixelFamily::kI420, w, h)), lost(w * h), uncovered(w * h) {
    for (size_t i = 0; i < samples.size(); i++) samples[i] = static_cast<int16_t>((i * 7919) % 16000);
    for (size_t i = static_cast<size_t>(w) * h; i < samples.size(); i++) samples[i] -= 8000;
    for (int i = 0; i < w * h; i++) {
      lost[i] = i % w / 40 == 3 || i / w % 7 == 6 ? static_cast<uint16_t>((i * 331) % 16000) : 0;
      uncovered[i] = i / w % 5 == 1 && i % w > w / 2 && i % 3 == 0;
    }
  }
  std::vector<uint8_t> picture(const Levels& levels) const {
    const size_t luma = static_cast<size_t>(w) * h;
    const int cw = chroma_size(w), ch = chroma_size(h);
    std::vector<uint8_t> out(samples.size());
    uint8_t* const plane[3] = {out.data(), &out[luma], &out[luma + static_cast<size_t>(cw) * ch]};
    const ptrdiff_t stride[3] = {w, cw, cw};
    resolve(sums(), uncovered.data(), {200, 30, 90}, {}, plane, stride, levels);
    return out;
  }
  ConstSumPlanes sums() const {
    return packed_sums<const int16_t, const uint16_t>(PixelFamily::kI420, {0, 0, w, h}, samples.data(), lost.data());
  }
  int w, h;
  std::vector<int16_t> samples;
  std::vector<uint16_t> lost;
  std::vector<uint8_t> uncovered;
};

TEST(Resolve, VideoLevelsAreScaledLevels) {
  for (const auto& [w, h] : {std::pair{301, 15}, {128, 8}, {2, 2}, {1, 1}}) {
    const Patchy patchy(w, h);
    const std::vector<uint8_t> full = patchy.picture(kFullLevels), video = patchy.picture(kVideoLevels);
    for (size_t i = 0; i < full.size(); i++) {
      const bool is_luma = i < static_cast<size_t>(w) * h;
      const double expected = is_luma ? 16 + full[i] * 219 / 255. : 128 + (full[i] - 128) * 224 / 255.;
      ASSERT_NEAR(video[i], expected, 0.95) << w << "x" << h << ": " << i;
      const bool is_plain = is_luma && patchy.lost[i] == 0 && !patchy.uncovered[i];
      if (is_plain) {
        ASSERT_NEAR(video[i], 16 + patchy.samples[i] / 128. * 219 / 255, 0.51) << i;
      }
    }
  }
}

// A column does not depend on its neighbours; exact ties may round differently with headroom.
TEST(Resolve, ColumnsAreIndependent) {
  const Patchy all(300, 14);
  for (const Levels& levels : {kFullLevels, kVideoLevels}) {
    const std::vector<uint8_t> whole = all.picture(levels);
    for (const int x : {0, 64, 128, 200, 298}) {
      Patchy some(std::min(100, 300 - x), 14);
      for (int y = 0; y < 14; y++)
        for (int i = 0; i < some.w; i++) {
          some.samples[y * some.w + i] = all.samples[y * 300 + x + i];
          some.lost[y * some.w + i] = all.lost[y * 300 + x + i];
          some.uncovered[y * some.w + i] = all.uncovered[y * 300 + x + i];
        }
      const std::vector<uint8_t> part = some.picture(levels);
      for (int y = 0; y < 14; y++)
        for (int i = 0; i < some.w; i++)
          ASSERT_NEAR(part[y * some.w + i], whole[y * 300 + x + i], levels == kFullLevels ? 0 : 1)
              << x + i << ", " << y;
    }
  }
}

TEST(Resolve, UncoveredPixelsShowTheBackground) {
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
  EXPECT_EQ(red(2), 9);
  EXPECT_EQ(out[4 * 3 + 3], 255);
  sums.lost = nullptr;
  resolve(sums, uncovered, {9, 8, 7}, {4, 0, 1, 2}, plane, stride);
  EXPECT_EQ(red(1), 9);
  EXPECT_EQ(red(2), 50);
}

constexpr int kWidth = 9, kHeight = 5;

Accumulator with_weight_left(PixelFamily family, double left, uint8_t grey) {
  Accumulator sum = test::empty_sum(family, kWidth, kHeight);
  Fragment fragment{family, {0, 0, kWidth, kHeight}, {}, {}};
  fragment.pixels.assign(packed_size(family, kWidth, kHeight), 0);
  const size_t grey_bytes = family == PixelFamily::kRgb ? fragment.pixels.size() : size_t{kWidth} * kHeight;
  std::fill_n(fragment.pixels.begin(), grey_bytes, static_cast<uint8_t>(grey * left + 0.5));
  EXPECT_TRUE(sum.add(fragment));
  EXPECT_TRUE(sum.add_missing_weights({0, 0, kWidth, kHeight},
                                      std::vector<float>(size_t{kWidth} * kHeight, static_cast<float>(1 - left))));
  return sum;
}

Image concealed(PixelFamily family, double left, uint8_t grey, uint8_t before_grey) {
  const Accumulator sum = with_weight_left(family, left, grey);
  Image picture = sum.resolve(), before(family, kWidth, kHeight);
  std::fill(before.data().begin(), before.data().end(), before_grey);
  uint8_t* plane[3] = {};
  ptrdiff_t stride[3] = {};
  for (int c = 0; c < (family == PixelFamily::kRgb ? 1 : 3); c++) {
    plane[c] = picture.plane(c);
    stride[c] = picture.view().stride[c];
  }
  conceal(*sum.sums(), before.view(), plane, stride);
  return picture;
}

class Conceal : public testing::TestWithParam<PixelFamily> {};

TEST_P(Conceal, LostPixelsShowThePreviousPicture) {
  for (const double left : {0.0, 0.05, 0.125}) {
    const Image picture = concealed(GetParam(), left, 200, 90);
    for (const uint8_t value : picture.data()) ASSERT_EQ(value, 90) << left;
  }
}

TEST_P(Conceal, OtherPixelsStay) {
  for (const double left : {0.25, 0.5, 1.0}) {
    const Image expected = with_weight_left(GetParam(), left, 200).resolve();
    EXPECT_EQ(concealed(GetParam(), left, 200, 90).data(), expected.data()) << left;
  }
}

TEST_P(Conceal, InBetweenIsMixed) {
  const Image picture = concealed(GetParam(), 0.1875, 200, 90);
  EXPECT_NEAR(picture.data()[0], 145, 3);
}

INSTANTIATE_TEST_SUITE_P(Families, Conceal, testing::Values(PixelFamily::kRgb, PixelFamily::kI420),
                         [](const auto& info) { return info.param == PixelFamily::kRgb ? "Rgb" : "I420"; });

TEST(ConcealNv12, EqualsPlanes) {
  constexpr int kChroma = 5 * 3;
  const Accumulator sum = with_weight_left(PixelFamily::kI420, 0.2, 200);
  Image before(PixelFamily::kI420, kWidth, kHeight), picture = sum.resolve();
  for (size_t i = 0; i < before.data().size(); i++) before.data()[i] = static_cast<uint8_t>(i * 37);
  const auto interleaved = [](const Image& image) {
    std::vector<uint8_t> chroma;
    for (int i = 0; i < kChroma; i++) chroma.insert(chroma.end(), {image.plane(1)[i], image.plane(2)[i]});
    return chroma;
  };
  std::vector<uint8_t> luma(picture.plane(0), picture.plane(1)), chroma = interleaved(picture);
  std::vector<uint8_t> chroma_before = interleaved(before);
  uint8_t* planes[3] = {picture.plane(0), picture.plane(1), picture.plane(2)};
  conceal(*sum.sums(), before.view(), planes, picture.view().stride);
  ImageView view = before.view();
  view.plane[1] = chroma_before.data();
  view.plane[2] = chroma_before.data() + 1;
  view.stride[1] = view.stride[2] = 10;
  uint8_t* both[3] = {luma.data(), chroma.data(), chroma.data() + 1};
  const ptrdiff_t stride[3] = {kWidth, 10, 10};
  conceal(*sum.sums(), view, both, stride);
  EXPECT_TRUE(std::equal(luma.begin(), luma.end(), picture.plane(0)));
  EXPECT_EQ(chroma, interleaved(picture));
}

}  // namespace
}  // namespace lf
