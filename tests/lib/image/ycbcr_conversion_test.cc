// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/ycbcr_conversion.h"

#include <cmath>

#include <gtest/gtest.h>

#include "reference/generators.h"

namespace lf {
namespace {

struct Colour {
  double r, g, b;  // 0 to 1
};

// By the definitions, in double precision.
Colour colour_of(const YcbcrKind& kind, double y, double cb, double cr) {
  const double range = kind.full_range ? 255 : 219, chroma = kind.full_range ? 255 : 224;
  y = (y - (kind.full_range ? 0 : 16)) / range;
  cb = (cb - 128) / chroma;
  cr = (cr - 128) / chroma;
  const double r = y + 2 * (1 - kind.kr) * cr, b = y + 2 * (1 - kind.kb) * cb;
  return {r, (y - kind.kr * r - kind.kb * b) / (1 - kind.kr - kind.kb), b};
}
struct Levels {
  double y, cb, cr;
};
Levels levels_of(const Colour& c) {
  const double y = 0.299 * c.r + 0.587 * c.g + 0.114 * c.b;
  return {255 * y, 128 + 255 * (c.b - y) / (2 * (1 - 0.114)), 128 + 255 * (c.r - y) / (2 * (1 - 0.299))};
}

const YcbcrKind kKinds[] = {
    {},
    {.full_range = false},
    {.kr = 0.2126, .kb = 0.0722, .full_range = true},
    {.kr = 0.2126, .kb = 0.0722, .full_range = false, .right = -0.5},
    {.kr = 0.2627, .kb = 0.0593, .full_range = false, .right = -0.5, .down = -0.5},
    {.full_range = false, .down = -0.5},
};

Image converted(const YcbcrKind& kind, const Image& in) {
  Image out(PixelFamily::kI420, in.width(), in.height());
  const ImageView to = out.view();
  uint8_t* const planes[3] = {out.plane(0), out.plane(1), out.plane(2)};
  YcbcrConversion(kind).convert(in.view(), planes, to.stride);
  return out;
}

// Every pixel of noise, of sizes that are odd, too.
TEST(YcbcrConversion, IsExactArithmeticToALevel) {
  reference::Random random(21);
  for (const YcbcrKind& kind : kKinds)
    for (const auto& [width, height] : {std::pair{32, 18}, {17, 9}, {1, 1}, {2, 7}}) {
      Image in(PixelFamily::kI420, width, height);
      for (uint8_t& value : in.data()) value = static_cast<uint8_t>(random.uniform(0, 256));
      const Image out = converted(kind, in);
      const int cw = chroma_size(width), ch = chroma_size(height);
      const auto chroma = [&](int plane, int x, int y) {
        const auto at = [&](int i, int j) {
          return static_cast<double>(in.plane(plane)[std::min(j, ch - 1) * cw + std::min(i, cw - 1)]);
        };
        const double a = -kind.right / 2, b = -kind.down / 2;
        return (at(x, y) * (1 - a) + at(x + 1, y) * a) * (1 - b) + (at(x, y + 1) * (1 - a) + at(x + 1, y + 1) * a) * b;
      };
      for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
          const double cb = chroma(1, x / 2, y / 2), cr = chroma(2, x / 2, y / 2);
          const Levels exact = levels_of(colour_of(kind, in.plane(0)[y * width + x], cb, cr));
          ASSERT_NEAR(out.plane(0)[y * width + x], std::clamp(exact.y, 0., 255.), 0.52) << x << ", " << y;
          ASSERT_NEAR(out.plane(1)[y / 2 * cw + x / 2], std::clamp(exact.cb, 0., 255.), 0.52) << x << ", " << y;
          ASSERT_NEAR(out.plane(2)[y / 2 * cw + x / 2], std::clamp(exact.cr, 0., 255.), 0.52) << x << ", " << y;
        }
    }
}

TEST(YcbcrConversion, TheOwnKindStaysAsItIs) {
  reference::Random random(22);
  Image in(PixelFamily::kI420, 30, 22);
  for (uint8_t& value : in.data()) value = static_cast<uint8_t>(random.uniform(0, 256));
  EXPECT_EQ(converted({}, in).data(), in.data());
}

// Black, white and what cameras call so: the ends of the range are the ends of ours, and what lies beyond is at them.
TEST(YcbcrConversion, TheEndsOfTheRange) {
  for (const auto& [from, to] : {std::pair{0, 0}, {16, 0}, {126, 128}, {181, 192}, {235, 255}, {255, 255}}) {
    Image in(PixelFamily::kI420, 4, 4);
    std::fill(in.data().begin(), in.data().end(), uint8_t{128});
    std::fill_n(in.plane(0), 16, static_cast<uint8_t>(from));
    const Image out = converted({.full_range = false}, in);
    for (int i = 0; i < 16; i++) EXPECT_EQ(out.plane(0)[i], to) << from;
    EXPECT_EQ(out.plane(1)[0], 128);
    EXPECT_EQ(out.plane(2)[3], 128);
  }
}

}  // namespace
}  // namespace lf
