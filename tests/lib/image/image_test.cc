// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/image.h"
#include "reference/generators.h"
#include "support/expect_error.h"
#include "support/test.h"

namespace lf {
namespace {

TEST(Image, PackedSizesCountOddEdges) {
  EXPECT_EQ(packed_size(PixelFamily::kRgb, 3, 5), 45u);
  EXPECT_EQ(packed_size(PixelFamily::kI420, 4, 2), 12u);
  EXPECT_EQ(packed_size(PixelFamily::kI420, 3, 5), 15u + 2 * 2 * 3);
  EXPECT_EQ(packed_size(PixelFamily::kI420, 1, 1), 3u);
  EXPECT_EQ(packed_size(PixelFamily::kRgb, 16384, 16384), size_t{16384} * 16384 * 3);
  EXPECT_EQ(packed_size(PixelFamily::kNone, 4, 4), 0u);
}

TEST(Image, ViewDescribesThePlanes) {
  Image image(PixelFamily::kI420, 3, 5);
  const ImageView view = image.view();
  EXPECT_EQ(view.stride[0], 3);
  EXPECT_EQ(view.stride[1], 2);
  EXPECT_EQ(view.plane[1] - view.plane[0], 15);
  EXPECT_EQ(view.plane[2] - view.plane[1], 6);
  EXPECT_EQ(view.plane[2] + 6, image.data().data() + image.data().size());

  const Image rgb(PixelFamily::kRgb, 3, 5);
  EXPECT_EQ(rgb.view().stride[0], 9);
  EXPECT_EQ(rgb.pixel(2, 4) - rgb.view().plane[0], 42);
}

// Values of JFIF 1.02, section "Conversion to and from RGB".
TEST(Image, ConvertsColoursAsJfif) {
  struct {
    uint8_t rgb[3], ycc[3];
  } const cases[] = {{{0, 0, 0}, {0, 128, 128}},    {{255, 255, 255}, {255, 128, 128}},
                     {{255, 0, 0}, {76, 85, 255}},  {{0, 255, 0}, {150, 44, 21}},
                     {{0, 0, 255}, {29, 255, 107}}, {{128, 128, 128}, {128, 128, 128}}};
  for (const auto& c : cases) {
    Image rgb(PixelFamily::kRgb, 2, 2);
    for (int i = 0; i < 4; i++) std::copy(c.rgb, c.rgb + 3, rgb.pixel(i % 2, i / 2));
    const Image ycc = to_i420(rgb);
    for (int p = 0; p < 3; p++) EXPECT_EQ(ycc.plane(p)[0], c.ycc[p]) << "plane " << p;
    const Image back = to_rgb(ycc);
    for (int p = 0; p < 3; p++) EXPECT_NEAR(back.pixel(1, 1)[p], c.rgb[p], 2);
  }
}

TEST(Image, ChromaIsTheMeanOfItsPixels) {
  Image rgb(PixelFamily::kRgb, 3, 3);
  for (int y = 0; y < 3; y++)
    for (int x = 0; x < 3; x++) rgb.pixel(x, y)[2] = static_cast<uint8_t>(10 * x + 60 * y);
  const Image ycc = to_i420(rgb);
  const int mean[4] = {(0 + 10 + 60 + 70) / 4, (20 + 80) / 2, (120 + 130) / 2, 140};
  for (int i = 0; i < 4; i++) EXPECT_NEAR(ycc.plane(1)[i], 128 + 0.5 * mean[i], 0.51) << i;
}

TEST(Image, GreysRoundTrip) {
  Image rgb(PixelFamily::kRgb, 16, 16);
  for (int i = 0; i < 256; i++)
    for (int c = 0; c < 3; c++) rgb.pixel(i % 16, i / 16)[c] = static_cast<uint8_t>(i);
  EXPECT_EQ(to_rgb(to_i420(rgb)).data(), rgb.data());
}

struct Colour {
  double r, g, b;  // 0 to 1
};

// Computes the definition in double precision.
Colour colour_of(const YcbcrFormat& kind, double y, double cb, double cr) {
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

const YcbcrFormat kKinds[] = {
    {},
    {.full_range = false},
    {.kr = 0.2126, .kb = 0.0722, .full_range = true},
    {.kr = 0.2126, .kb = 0.0722, .full_range = false, .right = -0.5},
    {.kr = 0.2627, .kb = 0.0593, .full_range = false, .right = -0.5, .down = -0.5},
    {.full_range = false, .down = -0.5},
};

Image converted(const YcbcrFormat& kind, const Image& in) {
  Image out(PixelFamily::kI420, in.width(), in.height());
  const ImageView to = out.view();
  uint8_t* const planes[3] = {out.plane(0), out.plane(1), out.plane(2)};
  YcbcrConversion(kind).convert(in.view(), planes, to.stride);
  return out;
}

Image noise(int width, int height, reference::Random& random) {
  Image image(PixelFamily::kI420, width, height);
  for (uint8_t& value : image.data()) value = static_cast<uint8_t>(random.uniform(0, 256));
  return image;
}

TEST(YcbcrConversion, IsExactToALevel) {
  reference::Random random(21);
  for (const YcbcrFormat& kind : kKinds)
    for (const auto& [width, height] : {std::pair{32, 18}, {17, 9}, {1, 1}, {2, 7}}) {
      const Image in = noise(width, height, random);
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

TEST(YcbcrConversion, SameFormatIsUnchanged) {
  reference::Random random(22);
  const Image in = noise(30, 22, random);
  EXPECT_EQ(converted({}, in).data(), in.data());
}

TEST(YcbcrConversion, EndsOfTheRange) {
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

double brightness(const std::array<uint8_t, 3>& c) { return 0.299 * c[0] + 0.587 * c[1] + 0.114 * c[2]; }

TEST(HeatColour, BrightnessIncreasesFromBlackToYellow) {
  EXPECT_LT(brightness(heat_colour(0)), 1);
  EXPECT_GT(brightness(heat_colour(1)), 230);
  for (int i = 1; i <= 200; i++)
    EXPECT_GE(brightness(heat_colour(i / 200.0)), brightness(heat_colour((i - 1) / 200.0)) - 0.5) << i;
  EXPECT_EQ(heat_colour(-3), heat_colour(0));
  EXPECT_EQ(heat_colour(7), heat_colour(1));
  EXPECT_EQ(heat_colour(0.5), (std::array<uint8_t, 3>{188, 55, 84}));
}

TEST(HeatColour, IsNeverTheGreyOfMissingValues) {
  for (int i = 0; i <= 1000; i++)
    EXPECT_NE(heat_colour(i / 1000.0), (std::array<uint8_t, 3>{kNoValueGrey, kNoValueGrey, kNoValueGrey}));
}

TEST(HeatMap, ScalesValues) {
  const std::vector<float> values{0, 5, 10, 20, NAN, 2.5};
  const Image map = heat_map(values, 3, 2, 10);
  const auto at = [&](int x, int y) {
    return std::array<uint8_t, 3>{map.pixel(x, y)[0], map.pixel(x, y)[1], map.pixel(x, y)[2]};
  };
  EXPECT_EQ(at(0, 0), heat_colour(0));
  EXPECT_EQ(at(1, 0), heat_colour(0.5));
  EXPECT_EQ(at(2, 0), heat_colour(1));
  EXPECT_EQ(at(0, 1), heat_colour(1)) << "beyond the scale";
  EXPECT_EQ(at(1, 1), (std::array<uint8_t, 3>{kNoValueGrey, kNoValueGrey, kNoValueGrey}));
  EXPECT_EQ(at(2, 1), heat_colour(0.25));
}

TEST(HeatMap, UnderlayShowsThroughSmallValues) {
  Image under(PixelFamily::kRgb, 2, 1);
  for (uint8_t& v : under.data()) v = 200;
  const Image map = heat_map(std::vector<float>{0, 1}, 2, 1, 1, &under);
  EXPECT_NEAR(map.pixel(0, 0)[1], 80, 1);
  EXPECT_EQ(map.pixel(1, 0)[1], heat_colour(1)[1]);
  EXPECT_ERROR(heat_map(std::vector<float>{0, 1}, 1, 2, 1, &under), "the same size");
  EXPECT_ERROR(heat_map(std::vector<float>{0, 1, 2}, 2, 1, 1), "the same size");
}

}  // namespace
}  // namespace lf
