// SPDX-License-Identifier: LGPL-2.1-or-later
#include "reference/exact_quality.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"

namespace lf {
namespace {

FloatStill flat(PixelFamily family, int width, int height, double value) {
  FloatStill still{family, width, height};
  still.colour.assign(packed_size(family, width, height), value);
  still.valid.assign(static_cast<size_t>(width) * height, 1);
  still.lost.assign(still.valid.size(), 0);
  return still;
}

TEST(ExactQuality, ErrorsAreThoseOfRealNumbers) {
  FloatStill exact = flat(PixelFamily::kRgb, 2, 2, 0.25);
  exact.colour[5] = 3;
  const ExactQuality quality = compare(Image(PixelFamily::kRgb, 2, 2), exact);
  EXPECT_EQ(quality.max_error, 3);
  EXPECT_NEAR(quality.psnr_db, 10 * std::log10(255 * 255 * 12 / (11 * 0.0625 + 9)), 1e-9);
  EXPECT_EQ(quality.coverage, 1);
}

TEST(ExactQuality, OnlyWhatIsCoveredCounts) {
  FloatStill exact = flat(PixelFamily::kRgb, 2, 1, 0);
  exact.colour[3] = 99;
  exact.valid[1] = 0.9;
  const ExactQuality quality = compare(Image(PixelFamily::kRgb, 2, 1), exact);
  EXPECT_EQ(quality.max_error, 0);
  EXPECT_EQ(quality.psnr_db, INFINITY);
  EXPECT_EQ(quality.coverage, 0.5);
  exact.valid[0] = 0;
  EXPECT_TRUE(std::isnan(compare(Image(PixelFamily::kRgb, 2, 1), exact).max_error));
}

TEST(ExactQuality, AChromaSampleNeedsAllItsPixels) {
  FloatStill exact = flat(PixelFamily::kI420, 4, 2, 0);
  exact.colour[8 + 1] = 10;  // Cb of the right half
  EXPECT_EQ(compare(Image(PixelFamily::kI420, 4, 2), exact).max_error, 10);
  exact.valid[3] = 0.5;
  EXPECT_EQ(compare(Image(PixelFamily::kI420, 4, 2), exact).max_error, 0);
}

TEST(ExactQuality, UnlikePicturesAreAnError) {
  EXPECT_THROW(compare(Image(PixelFamily::kRgb, 2, 1), flat(PixelFamily::kRgb, 1, 2, 0)), Error);
  EXPECT_THROW(compare(Image(PixelFamily::kRgb, 2, 2), flat(PixelFamily::kI420, 2, 2, 0)), Error);
}

}  // namespace
}  // namespace lf
