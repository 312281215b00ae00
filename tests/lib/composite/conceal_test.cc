// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/resolve.h"

#include <gtest/gtest.h>

#include "composite/accumulator.h"
#include "render/sum_planes.h"

namespace lf {
namespace {

constexpr int kWidth = 9, kHeight = 5;

// One camera's grey with `left` of the weight, the rest of it lost; odd sizes.
Accumulator with_weight_left(PixelFamily family, double left, uint8_t grey) {
  Accumulator sum;
  sum.reset(family, kWidth, kHeight);
  Fragment fragment{family, {0, 0, kWidth, kHeight}, {}, {}};
  fragment.pixels.assign(packed_size(family, kWidth, kHeight), 0);
  const size_t grey_bytes = family == PixelFamily::kRgb ? fragment.pixels.size() : size_t{kWidth} * kHeight;
  std::fill_n(fragment.pixels.begin(), grey_bytes, static_cast<uint8_t>(grey * left + 0.5));
  EXPECT_TRUE(sum.add(fragment));
  EXPECT_TRUE(sum.add_lost_weights({0, 0, kWidth, kHeight},
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

TEST_P(Conceal, WhatIsLostIsThePictureBefore) {
  for (const double left : {0.0, 0.05, 0.125}) {
    const Image picture = concealed(GetParam(), left, 200, 90);
    for (const uint8_t value : picture.data()) ASSERT_EQ(value, 90) << left;
  }
}

TEST_P(Conceal, WhatIsLeftStays) {
  for (const double left : {0.25, 0.5, 1.0}) {
    const Image expected = with_weight_left(GetParam(), left, 200).resolve();
    EXPECT_EQ(concealed(GetParam(), left, 200, 90).data(), expected.data()) << left;
  }
}

TEST_P(Conceal, BetweenThemIsAMixture) {
  const Image picture = concealed(GetParam(), 0.1875, 200, 90);
  EXPECT_NEAR(picture.data()[0], 145, 3);
}

INSTANTIATE_TEST_SUITE_P(Families, Conceal, testing::Values(PixelFamily::kRgb, PixelFamily::kI420),
                         [](const auto& info) { return info.param == PixelFamily::kRgb ? "Rgb" : "I420"; });

TEST(ConcealNv12, IsThatOfPlanes) {
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
