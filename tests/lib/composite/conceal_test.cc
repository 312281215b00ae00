// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/conceal.h"

#include <gtest/gtest.h>

#include "composite/accumulator.h"
#include "render/fragment.h"

namespace lf {
namespace {

constexpr int kWidth = 9, kHeight = 5;

// One camera's grey with `left` of the weight, the rest of it lost; odd sizes.
Accumulator with_weight_left(PixelFamily family, double left, uint8_t grey) {
  Accumulator sum;
  sum.reset(family, kWidth, kHeight);
  Fragment fragment{0, family, {0, 0, kWidth, kHeight}, {}, {}};
  fragment.pixels.assign(packed_size(family, kWidth, kHeight), 0);
  const size_t grey_bytes = family == PixelFamily::kRgb ? fragment.pixels.size() : size_t{kWidth} * kHeight;
  std::fill_n(fragment.pixels.begin(), grey_bytes, static_cast<uint8_t>(grey * left + 0.5));
  EXPECT_TRUE(sum.add(fragment));
  EXPECT_TRUE(sum.add_lost_hat({0, 0, kWidth, kHeight},
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

}  // namespace
}  // namespace lf
