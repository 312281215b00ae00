// SPDX-License-Identifier: LGPL-2.1-or-later
#include "quality/prediction.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "base/error.h"
#include "scene/scene.h"

namespace lf {
namespace {

// The scene from the origin, its lens moved by `shift` pixels; brighter by `gain`.
Image picture(const Vec2& shift = {0, 0}, double gain = 1) {
  Image image = render_scene({80, 60, Lens::pinhole(80, 39.5 + shift.x, 29.5 + shift.y), {}}, 0.5);
  for (uint8_t& v : image.data()) v = static_cast<uint8_t>(std::min(255.0, v * gain + 0.5));
  return image;
}

TEST(Prediction, OfItselfIsPerfect) {
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

TEST(Prediction, WhatIsNotPredictedDoesNotCount) {
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

TEST(Prediction, NothingIsToldOfNothing) {
  const Image flat(PixelFamily::kRgb, 80, 60);
  EXPECT_TRUE(std::isnan(compare_prediction(flat, flat, {}).gain));
  EXPECT_TRUE(std::isnan(compare_prediction(picture(), picture(), std::vector<float>(80 * 60)).psnr_db));
  EXPECT_THROW(compare_prediction(picture(), Image(PixelFamily::kRgb, 8, 8), {}), Error);
}

}  // namespace
}  // namespace lf
