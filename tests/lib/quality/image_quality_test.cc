// SPDX-License-Identifier: LGPL-2.1-or-later
#include "quality/image_quality.h"

#include <opencv2/imgproc.hpp>

#include "base/text.h"
#include "scene/scene.h"
#include "support/expect_error.h"
#include "support/test.h"

namespace lf {
namespace {

Image noise(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  Image image(PixelFamily::kRgb, width, height);
  for (uint8_t& v : image.data()) v = static_cast<uint8_t>(random() % 256);
  return image;
}

Image disturbed(const Image& image, int amount, unsigned seed) {
  std::mt19937 random(seed);
  Image out = image;
  for (uint8_t& v : out.data()) {
    const int change = static_cast<int>(random() % (2 * amount + 1)) - amount;
    v = static_cast<uint8_t>(std::clamp(v + change, 0, 255));
  }
  return out;
}

Image grey(int width, int height, uint8_t value) {
  Image image(PixelFamily::kRgb, width, height);
  std::fill(image.data().begin(), image.data().end(), value);
  return image;
}

cv::Mat luma(const Image& image) {
  cv::Mat out(image.height(), image.width(), CV_64F);
  for (int y = 0; y < image.height(); y++)
    for (int x = 0; x < image.width(); x++) {
      const uint8_t* p = image.pixel(x, y);
      out.at<double>(y, x) = 0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2];
    }
  return out;
}

// A window clipped at the border and renormalised = blur with zeros outside / blur of ones with zeros outside.
cv::Mat window_mean(const cv::Mat& in) {
  cv::Mat sum, weight;
  cv::GaussianBlur(in, sum, {11, 11}, 1.5, 1.5, cv::BORDER_CONSTANT);
  cv::GaussianBlur(cv::Mat::ones(in.size(), CV_64F), weight, {11, 11}, 1.5, 1.5, cv::BORDER_CONSTANT);
  return sum / weight;
}

cv::Mat reference_ssim(const Image& a, const Image& b) {
  const cv::Mat x = luma(a), y = luma(b), mx = window_mean(x), my = window_mean(y);
  const cv::Mat vx = window_mean(x.mul(x)) - mx.mul(mx), vy = window_mean(y.mul(y)) - my.mul(my);
  const cv::Mat cov = window_mean(x.mul(y)) - mx.mul(my);
  const double c1 = 6.5025, c2 = 58.5225;
  const cv::Mat numerator = (2 * mx.mul(my) + c1).mul(2 * cov + c2);
  const cv::Mat denominator = (mx.mul(mx) + my.mul(my) + c1).mul(vx + vy + c2);
  return numerator / denominator;
}

TEST(Quality, EqualPictures) {
  const Image a = noise(40, 30, 1);
  const Quality q = compare(a, a);
  EXPECT_EQ(q.psnr_db, std::numeric_limits<double>::infinity());
  EXPECT_EQ(q.ssim, 1);
  EXPECT_EQ(q.max_error, 0);
  EXPECT_EQ(q.coverage, 1);
}

TEST(Quality, PsnrOfAKnownError) {
  const Quality q = compare(grey(20, 10, 110), grey(20, 10, 100));
  EXPECT_NEAR(q.psnr_db, 10 * std::log10(255.0 * 255.0 / 100.0), 1e-12);
  EXPECT_EQ(q.max_error, 10);
  // Without texture, only the luminance term remains: (2 ab + C1) / (a^2 + b^2 + C1).
  EXPECT_NEAR(q.ssim, (2 * 110 * 100 + 6.5025) / (110 * 110 + 100 * 100 + 6.5025), 1e-9);
}

TEST(Quality, OneWrongChannelOfOnePixel) {
  Image a = grey(4, 4, 50);
  a.pixel(2, 1)[1] = 57;
  const Quality q = compare(a, grey(4, 4, 50));
  EXPECT_NEAR(q.psnr_db, 10 * std::log10(255.0 * 255.0 * 48 / 49), 1e-12);
  EXPECT_EQ(q.max_error, 7);
}

TEST(Quality, SsimAgreesWithOpenCvsGaussian) {
  for (const auto& [w, h] : {std::pair{64, 48}, {17, 33}, {11, 11}, {5, 3}, {1, 1}}) {
    const Image a = noise(w, h, 7);
    for (const int amount : {3, 40, 255}) {
      const Image b = disturbed(a, amount, 8);
      EXPECT_NEAR(compare(a, b).ssim, cv::mean(reference_ssim(a, b))[0], 1e-9) << w << "x" << h << " +-" << amount;
    }
  }
}

TEST(Quality, OnlyCoveredPixelsCount) {
  const Image truth = noise(32, 24, 3);
  Image picture = disturbed(truth, 5, 4);
  std::vector<float> coverage(32 * 24, 1.0f);
  for (int y = 0; y < 24; y++)
    for (int x = 0; x < 8; x++) {
      std::fill_n(picture.pixel(x, y), 3, 0);
      coverage[y * 32 + x] = x % 2 == 0 ? 0.0f : 0.999f;
    }
  const Quality q = compare(picture, truth, coverage);
  EXPECT_DOUBLE_EQ(q.coverage, 0.75);
  EXPECT_LE(q.max_error, 5);
  EXPECT_GT(q.psnr_db, 35);
  const cv::Mat map = reference_ssim(picture, truth);
  EXPECT_NEAR(q.ssim, cv::mean(map.colRange(8, 32))[0], 1e-9);
}

TEST(Quality, NothingCovered) {
  const Quality q = compare(grey(3, 3, 1), grey(3, 3, 2), std::vector<float>(9, 0.5f));
  EXPECT_TRUE(std::isnan(q.psnr_db));
  EXPECT_TRUE(std::isnan(q.ssim));
  EXPECT_EQ(q.coverage, 0);
}

TEST(Quality, RefusesIncomparablePictures) {
  EXPECT_THROW(compare(grey(3, 3, 1), grey(3, 4, 1)), Error);
  EXPECT_THROW(compare(grey(4, 4, 1), Image(PixelFamily::kI420, 4, 4)), Error);
  EXPECT_THROW(compare(grey(3, 3, 1), grey(3, 3, 1), std::vector<float>(8, 1.0f)), Error);
}

// The scene from the origin, with the lens shifted by `shift` pixels and `gain` times as bright.
Image picture(const Vec2& shift = {0, 0}, double gain = 1) {
  Image image = render_scene({80, 60, Lens::pinhole(80, 39.5 + shift.x, 29.5 + shift.y), {}}, 0.5);
  for (uint8_t& v : image.data()) v = static_cast<uint8_t>(std::min(255.0, v * gain + 0.5));
  return image;
}

TEST(Prediction, IsPerfectForEqualPictures) {
  const PredictionError error = compare_prediction(picture(), picture(), {});
  EXPECT_EQ(error.psnr_db, INFINITY);
  EXPECT_NEAR(error.gain, 1, 1e-9);
  EXPECT_NEAR(glm::length(error.shift), 0, 1e-9);
}

TEST(Prediction, GainAndShiftAreFound) {
  for (const Vec2 shift : {Vec2(1, 0), Vec2(0.4, -0.3), Vec2(-1.6, 1.2)})
    for (const double gain : {0.9, 1.0, 1.15}) {
      const PredictionError error = compare_prediction(picture(), picture(shift, gain), {});
      EXPECT_NEAR(error.gain, gain, 0.02);
      EXPECT_NEAR(error.shift.x, shift.x, 0.15);
      EXPECT_NEAR(error.shift.y, shift.y, 0.15);
    }
}

TEST(Prediction, IgnoresUncoveredPixels) {
  Image predicted = picture();
  std::vector<float> coverage(80 * 60, 1);
  for (int y = 0; y < 60; y++)
    for (int x = 0; x < 40; x++) {
      coverage[static_cast<size_t>(y) * 80 + x] = 0.5f;
      std::fill_n(predicted.pixel(x, y), 3, uint8_t{0});
    }
  const PredictionError error = compare_prediction(predicted, picture({0, 0}, 1.1), coverage);
  EXPECT_NEAR(error.gain, 1.1, 0.02);
  EXPECT_GT(error.psnr_db, 20);
}

TEST(Prediction, OutliersHaveLittleWeight) {
  Image seen = picture({0.5, 0});
  for (int y = 10; y < 25; y++)
    for (int x = 10; x < 25; x++) std::fill_n(seen.pixel(x, y), 3, uint8_t{255});
  const PredictionError error = compare_prediction(picture(), seen, {});
  EXPECT_NEAR(error.gain, 1, 0.03);
  EXPECT_NEAR(error.shift.x, 0.5, 0.15);
}

TEST(Prediction, IsUnknownWithoutCoverage) {
  const Image flat(PixelFamily::kRgb, 80, 60);
  EXPECT_TRUE(std::isnan(compare_prediction(flat, flat, {}).gain));
  EXPECT_TRUE(std::isnan(compare_prediction(picture(), picture(), std::vector<float>(80 * 60)).psnr_db));
  EXPECT_THROW(compare_prediction(picture(), Image(PixelFamily::kRgb, 8, 8), {}), Error);
}

TEST(Differences, MatchThePsnr) {
  Image a(PixelFamily::kRgb, 7, 5), b(PixelFamily::kRgb, 7, 5);
  for (size_t i = 0; i < a.data().size(); i++) {
    a.data()[i] = static_cast<uint8_t>(37 * i % 251);
    b.data()[i] = static_cast<uint8_t>(101 * i % 241);
  }
  std::vector<float> coverage(35, 1);
  coverage[3] = 0.5f;
  const std::vector<float> off = differences(a, b, coverage);
  ASSERT_EQ(off.size(), 35u);
  double squares = 0;
  EXPECT_TRUE(std::isnan(off[3])) << "not counted";
  for (size_t i = 0; i < 35; i++) {
    if (i == 3) continue;
    double sum = 0;
    for (size_t c = 0; c < 3; c++) sum += std::pow(double{a.data()[3 * i + c] * 1.0} - b.data()[3 * i + c], 2);
    EXPECT_NEAR(off[i], std::sqrt(sum / 3), 1e-4);
    squares += off[i] * off[i];
  }
  EXPECT_NEAR(compare(a, b, coverage).psnr_db, 10 * std::log10(255 * 255 * 34 / squares), 1e-4);
  EXPECT_ERROR(differences(a, Image(PixelFamily::kRgb, 5, 7)), "differ in size");
  EXPECT_ERROR(differences(a, b, {1, 1}), "coverage", "2 values");
}

}  // namespace
}  // namespace lf
