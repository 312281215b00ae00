// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/patch.h"

#include <cmath>

#include <gtest/gtest.h>

namespace lf {
namespace {

double wave(double x, double y) { return 128 + 60 * std::sin(0.8 * x + 0.3) * std::cos(0.6 * y); }

Image picture() {
  Image image(PixelFamily::kRgb, 40, 30);
  for (int y = 0; y < 30; y++)
    for (int x = 0; x < 40; x++)
      for (int c = 0; c < 3; c++) image.pixel(x, y)[c] = static_cast<uint8_t>(std::lround(wave(x, y)));
  return image;
}

TEST(SplineImage, GoesThroughThePixels) {
  const Image image = picture();
  const SplineImage spline(image);
  for (int y = 1; y < 28; y++)
    for (int x = 1; x < 38; x++) EXPECT_NEAR(spline.value(x, y), image.pixel(x, y)[0], 1e-2) << x << ' ' << y;
}

TEST(SplineImage, IsAsSharpBetweenPixelsAsOnThem) {
  const SplineImage spline(picture());
  for (double y = 6; y < 24; y += 0.37)
    for (double x = 6; x < 34; x += 0.41) {
      EXPECT_NEAR(spline.value(x, y), wave(x, y), 1.5);  // bilinear interpolation is 7 off
      const SplineImage::Sample s = spline.sample(x, y);
      EXPECT_FLOAT_EQ(s.value, spline.value(x, y));
      EXPECT_NEAR(s.dx, (spline.value(x + 0.01, y) - spline.value(x - 0.01, y)) / 0.02, 0.1);
      EXPECT_NEAR(s.dy, (spline.value(x, y + 0.01) - spline.value(x, y - 0.01)) / 0.02, 0.1);
    }
}

TEST(SplineImage, EndsWithItsImage) {
  const SplineImage spline(picture());
  EXPECT_TRUE(spline.has(1, 1));
  EXPECT_FALSE(spline.has(0.9, 5));
  EXPECT_TRUE(spline.has(37.9, 27.9));
  EXPECT_FALSE(spline.has(5, 28));
}

}  // namespace
}  // namespace lf
