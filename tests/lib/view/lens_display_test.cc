// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/lens_display.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "base/error.h"
#include "reference/generators.h"

namespace lf {
namespace {

struct Display {
  LensDisplay lenses;
  int columns, rows, view_width, view_height, width, height;
};

// The same in plain double precision. NaN where it is not a matter of computing exactly which view is seen.
double expected(const Display& d, const Image& quilt, int x, int y, int c) {
  const double across = x + (c - 1) / 3.0 - (d.width - 1) / 2.0, up = (d.height - 1) / 2.0 - y;
  const double lean = std::tan(d.lenses.slant * std::numbers::pi / 180);
  double lens = (across - up * lean) / d.lenses.lens_width - d.lenses.centre + 0.5;
  lens -= std::floor(lens);
  const int views = d.columns * d.rows;
  if (std::abs(lens * views - std::round(lens * views)) < 1e-4) return NAN;
  const int k = static_cast<int>(lens * views), view = d.lenses.reversed ? k : views - 1 - k;
  const int left = view % d.columns * d.view_width, top = (d.rows - 1 - view / d.columns) * d.view_height;
  const auto at = [&](int i, int j) {
    i = std::clamp(i, 0, d.view_width - 1);
    j = std::clamp(j, 0, d.view_height - 1);
    return static_cast<double>(quilt.pixel(left + i, top + j)[c]);
  };
  const double u = (x + 0.5) * d.view_width / d.width - 0.5, v = (y + 0.5) * d.view_height / d.height - 0.5;
  const int i = static_cast<int>(std::floor(u)), j = static_cast<int>(std::floor(v));
  const double a = u - i, b = v - j;
  return (at(i, j) * (1 - a) + at(i + 1, j) * a) * (1 - b) + (at(i, j + 1) * (1 - a) + at(i + 1, j + 1) * a) * b;
}

TEST(LensDisplay, EachSubpixelIsOfTheViewThatIsSeenThere) {
  reference::Random random(11);
  const Display displays[] = {
      {{4.7, 0, 0}, 5, 1, 24, 16, 150, 40},    {{9.31, 12.3, 0.4}, 4, 3, 20, 18, 97, 61},
      {{3.02, -35, -3.7}, 8, 6, 7, 5, 64, 48}, {{17.5, 9.5, 0.1, true}, 3, 2, 40, 30, 40, 30},
      {{0.9, 0, 0.25}, 2, 1, 31, 1, 60, 3},    {{1e4, 80, 12}, 1, 1, 16, 12, 33, 25},
  };
  for (const Display& d : displays) {
    SCOPED_TRACE(d.lenses.lens_width);
    Image quilt(PixelFamily::kRgb, d.columns * d.view_width, d.rows * d.view_height);
    for (uint8_t& value : quilt.data()) value = static_cast<uint8_t>(random.uniform(0, 256));
    const ptrdiff_t stride = ptrdiff_t{3} * d.width + 5;
    std::vector<uint8_t> out(static_cast<size_t>(stride * d.height), 77);
    interleave(d.lenses, {quilt.view(), d.columns, d.rows}, d.width, d.height, stride, out.data());
    int known = 0;
    for (int y = 0; y < d.height; y++) {
      for (int x = 0; x < d.width; x++)
        for (int c = 0; c < 3; c++) {
          const double value = expected(d, quilt, x, y, c);
          if (std::isnan(value)) continue;
          known++;
          ASSERT_NEAR(out[y * stride + 3 * x + c], value, 2) << x << ", " << y << ", " << c;
        }
      for (int i = 0; i < 5; i++) ASSERT_EQ(out[y * stride + 3 * d.width + i], 77) << "nothing is written beside rows";
    }
    EXPECT_GT(known, 3 * d.width * d.height * 9 / 10);
  }
}

// An eye far to the left sees, through each lens, what lies behind its right border: view 0 of the left-most eye.
TEST(LensDisplay, TheLeftEyeSeesTheLeftView) {
  const LensDisplay display{6, 0, 0};
  EXPECT_NEAR(display.place(0, 5), 0.5, 1e-12);
  EXPECT_NEAR(display.place(2.4, 0), 0.9, 1e-12);
  Image quilt(PixelFamily::kRgb, 6, 1);
  for (int view = 0; view < 6; view++)
    for (int c = 0; c < 3; c++) quilt.pixel(view, 0)[c] = static_cast<uint8_t>(40 * view);
  uint8_t out[3 * 7];
  interleave(display, {quilt.view(), 6, 1}, 7, 1, sizeof out, out);
  EXPECT_EQ(out[3 * 5 + 2], 0) << "2 pixels and a third to the right of the middle of a lens that is 6 wide";
  EXPECT_EQ(out[3 * 1 + 0], 200);
}

TEST(LensDisplay, BandsMakeNoDifference) {
  reference::Random random(12);
  Image quilt(PixelFamily::kRgb, 40, 30);
  for (uint8_t& value : quilt.data()) value = static_cast<uint8_t>(random.uniform(0, 256));
  std::vector<uint8_t> one(3 * 90 * 100), other(one.size());
  const LensDisplay display{5.3, 10, 0.3};
  interleave(display, {quilt.view(), 4, 3}, 90, 100, 270, one.data());
  interleave(display, {quilt.view(), 4, 3}, 90, 100, 270, other.data(), [](size_t count, const auto& task) {
    for (size_t i = count; i-- > 0;) task(i);
  });
  EXPECT_EQ(one, other);
}

TEST(LensDisplay, NeedsLensesThatThereCanBe) {
  for (const LensDisplay& none : {LensDisplay{0}, LensDisplay{-3}, LensDisplay{NAN}, LensDisplay{INFINITY},
                                  LensDisplay{4, 90}, LensDisplay{4, NAN}, LensDisplay{4, 0, INFINITY}})
    EXPECT_THROW(validate(none), Error);
  EXPECT_NO_THROW(validate(LensDisplay{4, -89, 100}));
}

}  // namespace
}  // namespace lf
