// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/colour_correction.h"
#include "support/every_target.h"
#include "support/test.h"

namespace lf {
namespace {

using testing::Optional;

TEST(ColourModel, DefaultChangesNothing) {
  for (const Vec3& level : {Vec3(0, 0, 0), Vec3(255, 255, 255), Vec3(1, 128, 254)})
    EXPECT_LE(glm::length(corrected({}, level) - level), 1e-9);
  EXPECT_EQ(level_factor(vignetting_factor({}, 1)), 1);
}

TEST(ColourModel, MatchesTheFormula) {
  const ColourModel model{.black = {4, 6, 8}, .gamma = 2, .matrix = {1.1, -.1, 0, 0, 1, 0, 0, .05, .9}};
  const double r = 100 - 4, g = 150 - 6, b = 200 - 8;
  const auto light = [](double v) { return std::pow(v / 255, 2); };
  const auto level = [](double l) { return 255 * std::pow(l, 1 / 2.2); };
  const Vec3 out = corrected(model, {100, 150, 200});
  EXPECT_NEAR(out.x, level(1.1 * light(r) - .1 * light(g)), 1e-9);
  EXPECT_NEAR(out.y, level(light(g)), 1e-9);
  EXPECT_NEAR(out.z, level(.05 * light(g) + .9 * light(b)), 1e-9);
}

TEST(ColourModel, LevelsBelowBlackAreNegative) {
  const ColourModel model{.black = {8, 8, 8}};
  EXPECT_NEAR(corrected(model, {-20, 8, 11}).x, -28, 1e-9);
  EXPECT_NEAR(corrected(model, {5, 8, 11}).x, -3, 1e-9);
  EXPECT_NEAR(corrected(model, {5, 8, 11}).y, 0, 1e-9);
  EXPECT_NEAR(corrected(model, {5, 8, 11}).z, 3, 1e-9);
}

TEST(ColourModel, LightIsLinearBelowTheToe) {
  EXPECT_NEAR(decode_gamma(128), std::pow(128 / 255., 2.2), 1e-12);
  EXPECT_NEAR(decode_gamma(128, 1.8), std::pow(128 / 255., 1.8), 1e-12);
  EXPECT_NEAR(decode_gamma(15), std::pow(30 / 255., 2.2) / 2, 1e-12);
  EXPECT_NEAR(decode_gamma(-8), -decode_gamma(8), 1e-12);
  for (const double gamma : {1.0, 2.2, 2.6})
    for (const double level : {-300.0, -30.0, -1.0, 0.0, 0.5, 29.99, 30.01, 200.0, 400.0})
      EXPECT_NEAR(encode_gamma(decode_gamma(level, gamma), gamma), level, 1e-9);
}

TEST(ColourModel, VignettingUsesHalfDiagonalsFromThePrincipalPoint) {
  const VignettingField field(301, 401, {150, 200});
  EXPECT_EQ(field.square(150, 200), 0);
  EXPECT_NEAR(field.square(0, 0), (150. * 150 + 200. * 200) / (301. * 301 + 401. * 401) * 4, 1e-12);
  EXPECT_EQ(field.most(), field.square(300, 400));
  const VignettingField shifted(301, 401, {140, 200});
  EXPECT_EQ(shifted.most(), shifted.square(300, 0)) << "the farthest corner";
  const ColourModel model{.vignetting = {-0.4, 0.1}};
  EXPECT_NEAR(vignetting_factor(model, 1), 0.7, 1e-12);
  EXPECT_NEAR(255 * std::pow(0.7, 1 / 2.2) * level_factor(0.7), 255, 1e-9) << "a factor of the levels";
}

TEST(ColourModel, ErrorsNameTheMemberAndTheBounds) {
  EXPECT_EQ(model_error({}, 1), std::nullopt);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(model_error({.black = {0, 70, 0}}, 1), Optional(mentions("black[1]", "-64 to 64")));
  EXPECT_THAT(model_error({.black = {0, 0, nan}}, 1), Optional(HasSubstr("black[2]")));
  EXPECT_THAT(model_error({.gamma = 0.2}, 1), Optional(mentions("gamma", "0.5 to 5")));
  EXPECT_THAT(model_error({.gamma = nan}, 1), Optional(HasSubstr("gamma")));
  EXPECT_THAT(model_error({.matrix = {1, 0, 0, 0, 1, 0, 0, 0, 4.1}}, 1), Optional(HasSubstr("matrix[8]")));
  EXPECT_THAT(model_error({.matrix = {1, 1, 0, 1, 1, 0, 0, 0, 1}}, 1), Optional(HasSubstr("determinant")));
  EXPECT_THAT(model_error({.vignetting = {-0.8, 0}}, 1), Optional(mentions("vignetting", "0.25 to 2.5")));
  EXPECT_EQ(model_error({.vignetting = {-0.74, 0}}, 1), std::nullopt);
  EXPECT_THAT(model_error({.vignetting = {-0.74, 0}}, 1.1), Optional(HasSubstr("vignetting")))
      << "larger image";
  EXPECT_THAT(model_error({.vignetting = {-4, 4}}, 1), Optional(HasSubstr("vignetting")))
      << "dark half-way, not at the end";
  EXPECT_THAT(model_error({.vignetting = {nan, 0}}, 1), Optional(HasSubstr("vignetting")));
}

constexpr Vec2 kCentre(151.3, 118.2);

Vec3 exact(const ColourModel& m, const Vec3& rgb, double x, double y, int width, int height) {
  const double half_diagonal = std::hypot(width, height) / 2;
  const double r = std::hypot(x - kCentre.x, y - kCentre.y) / half_diagonal;
  const double share = 1 + m.vignetting[0] * r * r + m.vignetting[1] * r * r * r * r;
  const auto light = [&m](double v) {
    const double l =
        std::abs(v) > 30 ? std::pow(std::abs(v) / 255, m.gamma) : std::abs(v) / 30 * std::pow(30 / 255., m.gamma);
    return v < 0 ? -l : l;
  };
  const auto level = [](double l) {
    const double toe = std::pow(30 / 255., 2.2), v = std::abs(l);
    const double e = v > toe ? 255 * std::pow(v, 1 / 2.2) : 30 * v / toe;
    return l < 0 ? -e : e;
  };
  Vec3 out;
  for (int i = 0; i < 3; i++) {
    double sum = 0;
    for (int j = 0; j < 3; j++) sum += m.matrix[3 * i + j] * light(rgb[j] - m.black[j]);
    out[i] = level(sum) / std::pow(share, 1 / 2.2);
  }
  return out;
}

// Typical errors of array cameras: 8 % gain, 5 % white balance, a tenth of gamma, crosstalk, corners 30 % darker.
ColourModel random_model(std::mt19937& random) {
  std::uniform_real_distribution<double> u(-1, 1);
  ColourModel m;
  const double gain = 1 + 0.08 * u(random);
  for (int c = 0; c < 3; c++) m.black[c] = 6 * u(random);
  m.gamma = 2.2 * (1 + 0.05 * u(random));
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) m.matrix[3 * i + j] = i == j ? gain * (1 + 0.05 * u(random)) : 0.02 * u(random);
  m.vignetting = {-0.25 + 0.05 * u(random), -0.05};
  return m;
}

Image random_image(PixelFamily family, int width, int height, std::mt19937& random) {
  Image rgb(PixelFamily::kRgb, width, height);
  std::uniform_real_distribution<double> u(0, 1);
  std::normal_distribution<double> noise(0, 2);
  double phase[3][3];
  for (auto& row : phase)
    for (double& p : row) p = 6.28 * u(random);
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++)
      for (int c = 0; c < 3; c++) {
        const double grey = 128 + 110 * std::sin(x * 0.031 + phase[0][0]) * std::cos(y * 0.023 + phase[0][1]);
        const double tint = 60 * std::sin(x * 0.017 * (c + 1) + phase[c][2]) * std::sin(y * 0.041 + phase[1][c]);
        rgb.pixel(x, y)[c] = static_cast<uint8_t>(std::clamp(std::lround(grey + tint + noise(random)), 0l, 255l));
      }
  return family == PixelFamily::kRgb ? rgb : to_i420(rgb);
}

struct Errors {
  double worst = 0, sum = 0, squares = 0;
  size_t count = 0, above_one = 0;
  void add(double error) {
    error = std::abs(error);
    worst = std::max(worst, error);
    sum += error;
    squares += error * error;
    above_one += error > 1;
    count++;
  }
  double mean() const { return sum / static_cast<double>(count); }
  double share_above_one() const { return static_cast<double>(above_one) / static_cast<double>(count); }
};

double in_range(double v) { return std::clamp(v, 0.0, 255.0); }

void compare_rgb(const ColourModel& m, const Image& in, const Image& out, Errors& errors) {
  for (int y = 0; y < in.height(); y++)
    for (int x = 0; x < in.width(); x++) {
      const uint8_t* p = in.pixel(x, y);
      const Vec3 want = exact(m, {p[0], p[1], p[2]}, x, y, in.width(), in.height());
      for (int c = 0; c < 3; c++) errors.add(out.pixel(x, y)[c] - in_range(want[c]));
    }
}

void compare_i420(const ColourModel& m, const Image& in, const Image& out, Errors& luma, Errors& chroma) {
  const int w = in.width(), h = in.height(), cw = chroma_size(w);
  const auto rgb_of = [](double y, double cb, double cr) {
    return Vec3(y + 1.402 * cr, y - 0.344136 * cb - 0.714136 * cr, y + 1.772 * cb);
  };
  const auto luma_of = [](const Vec3& rgb) { return 0.299 * rgb.x + 0.587 * rgb.y + 0.114 * rgb.z; };
  for (int y = 0; y < chroma_size(h); y++)
    for (int x = 0; x < cw; x++) {
      const double cb = in.plane(1)[y * cw + x] - 128.0, cr = in.plane(2)[y * cw + x] - 128.0;
      double mean = 0;
      for (int k = 0; k < 4; k++) {
        const int px = std::min(2 * x + k % 2, w - 1), py = std::min(2 * y + k / 2, h - 1);
        const double value = in.plane(0)[py * w + px];
        mean += value / 4;
        luma.add(out.plane(0)[py * w + px] - in_range(luma_of(exact(m, rgb_of(value, cb, cr), px, py, w, h))));
      }
      const Vec3 rgb = exact(m, rgb_of(mean, cb, cr), 2 * x + 0.5, 2 * y + 0.5, w, h);
      chroma.add(out.plane(1)[y * cw + x] - in_range(128 + (rgb.z - luma_of(rgb)) / 1.772));
      chroma.add(out.plane(2)[y * cw + x] - in_range(128 + (rgb.x - luma_of(rgb)) / 1.402));
    }
}

TEST(ColourCorrection, RgbIsCloseToDoublePrecision) {
  std::mt19937 random(1);
  Errors errors;
  for (int n = 0; n < 8; n++) {
    const Image image = random_image(PixelFamily::kRgb, 301, 201, random);
    const ColourModel model = random_model(random);
    compare_rgb(model, image, corrected(image, model, kCentre), errors);
  }
  EXPECT_LE(errors.mean(), 0.3) << "rounding to a level alone is 0.25";
  EXPECT_LE(errors.share_above_one(), 0.01);
  EXPECT_LE(errors.worst, 6) << "one channel nearly dark, others bright";
}

TEST(ColourCorrection, I420IsCloseToDoublePrecision) {
  std::mt19937 random(2);
  Errors luma, chroma;
  for (int n = 0; n < 8; n++) {
    const Image image = random_image(PixelFamily::kI420, 301, 201, random);
    const ColourModel model = random_model(random);
    compare_i420(model, image, corrected(image, model, kCentre), luma, chroma);
  }
  EXPECT_LE(luma.mean(), 0.3);
  EXPECT_LE(luma.share_above_one(), 0.01);
  EXPECT_LE(luma.worst, 6);
  EXPECT_LE(chroma.mean(), 0.3);
  EXPECT_LE(chroma.share_above_one(), 0.01);
  EXPECT_LE(chroma.worst, 6);
}

TEST(ColourCorrection, DefaultModelKeepsEveryLevel) {
  std::mt19937 random(3);
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420}) {
    const Image image = random_image(family, 50, 40, random);
    EXPECT_TRUE(ColourCorrection({}, family, 50, 40, kCentre).is_identity());
    EXPECT_EQ(corrected(image, {}, kCentre).data(), image.data());
    const ColourModel next{.vignetting = {1e-9, 0}};
    EXPECT_EQ(corrected(image, next, kCentre).data(), image.data());
  }
}

TEST(ColourCorrection, PartsEqualTheWhole) {
  std::mt19937 random(4);
  const ColourModel model = random_model(random);
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420})
    for (const Rect rect : {Rect{0, 0, 151, 61}, Rect{2, 4, 3, 5}, Rect{10, 2, 151, 60}, Rect{38, 20, 80, 61},
                            Rect{100, 60, 151, 61}, Rect{6, 6, 40, 8}}) {
      const Image image = random_image(family, 151, 61, random);
      const ColourCorrection correction(model, family, 151, 61, {75, 30});
      const Image whole = corrected(image, model, {75, 30});
      ByteBuffer memory(image.data().size(), 77);
      const ImageView out = correction.apply(image.view(), rect, memory);
      const bool rgb = family == PixelFamily::kRgb;
      for (int c = 0; c < (rgb ? 1 : 3); c++) {
        const int half = c > 0 ? 2 : 1, w = c > 0 ? 76 : 151, h = c > 0 ? 31 : 61;
        const Rect part{rect.x0 / half, rect.y0 / half, (rect.x1 + half - 1) / half, (rect.y1 + half - 1) / half};
        for (int y = 0; y < h; y++)
          for (int x = 0; x < w * (rgb ? 3 : 1); x++) {
            const int px = rgb ? x / 3 : x;
            // In 4:2:0, pairs of rows and columns share chroma.
            const bool in = px >= part.x0 && px < part.x1 && y >= part.y0 && y < part.y1;
            const bool in_pair = !rgb && c == 0 && px / 2 < (part.x1 + 1) / 2 && y / 2 < (part.y1 + 1) / 2 &&
                                 px >= part.x0 && y >= part.y0;
            const int value = out.plane[c][y * out.stride[c] + x];
            const int expected = in ? whole.plane(c)[static_cast<ptrdiff_t>(y) * (rgb ? 3 * w : w) + x] : 77;
            ASSERT_TRUE(value == expected || (in_pair && !in)) << "plane " << c << " at " << x << "," << y;
          }
      }
    }
}

TEST(ColourCorrection, EveryInstructionSetGivesTheSame) {
  std::mt19937 random(5);
  const ColourModel model = random_model(random);
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420}) {
    const Image image = random_image(family, 133, 37, random);
    const std::vector<uint8_t> best = corrected(image, model, {60, 5}).data();
    test::on_every_target([&] {
      const std::vector<uint8_t> out = corrected(image, model, {60, 5}).data();
      const auto differs = std::ranges::mismatch(out, best).in1;
      EXPECT_TRUE(differs == out.end()) << "from byte " << differs - out.begin() << " on";
    });
  }
}

TEST(ColourCorrection, FourthByteIsKept) {
  std::mt19937 random(6);
  const Image image = random_image(PixelFamily::kRgb, 45, 9, random);
  std::vector<uint8_t> bgrx;
  for (size_t i = 0; i < image.data().size(); i += 3)
    bgrx.insert(bgrx.end(), {image.data()[i + 2], image.data()[i + 1], image.data()[i], 201});
  const ColourModel model = random_model(random);
  const ColourCorrection correction(model, PixelFamily::kRgb, 45, 9, {60, 5});
  ImageView view{PixelFamily::kRgb, 45, 9, {4, 2, 1, 0}, {bgrx.data()}, {4 * 45}};
  ByteBuffer memory;
  const ImageView out = correction.apply(view, {0, 0, 45, 9}, memory);
  const Image want = corrected(image, model, {60, 5});
  for (size_t i = 0; i < 45 * 9; i++) {
    for (size_t c = 0; c < 3; c++) ASSERT_EQ(out.plane[0][4 * i + 2 - c], want.data()[3 * i + c]);
    ASSERT_EQ(out.plane[0][4 * i + 3], 201);
  }
}

TEST(ColourCorrection, LevelsAreClippedAtWhite) {
  Image image(PixelFamily::kI420, 64, 8);
  std::ranges::fill(image.data(), 128);
  std::fill_n(image.plane(0), 64 * 8, 250);
  const ColourModel twice{.matrix = {4, 0, 0, 0, 4, 0, 0, 0, 4}, .vignetting = {-0.5, 0}};
  const Image out = corrected(image, twice, {32, 4});
  EXPECT_EQ(*std::ranges::min_element(out.plane(0), out.plane(0) + 64 * 8), 255);
}

}  // namespace
}  // namespace lf
