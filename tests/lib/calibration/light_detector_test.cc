// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/light_detector.h"

#include <cmath>
#include <optional>

#include <gtest/gtest.h>

#include "scene/lights.h"
#include "support/expect_error.h"

namespace lf {
namespace {

std::vector<uint8_t> grey(const Image& rgb) {
  std::vector<uint8_t> samples(static_cast<size_t>(rgb.width()) * rgb.height());
  for (size_t i = 0; i < samples.size(); i++) samples[i] = rgb.data()[3 * i];
  return samples;
}

struct Errors {
  double squared = 0, normalised = 0, count = 0;
  size_t missed = 0;
  double rms() const { return std::sqrt(squared / (2 * count)); }              // of x and of y, pixels
  double of_predicted() const { return std::sqrt(normalised / (2 * count)); }  // 1 where sigmas are right
};

// Of the lights themselves, in pictures of the middle one of nine cameras; not of those at the border.
Errors errors_of(const LightsOptions& options, LightDetector& detector, int frames = 150) {
  const Rig rig = scene_rig(3, 3);
  const LightsPath path(rig, options);
  const Camera& camera = rig.cameras[4];
  const LightsCamera lights(path, {camera.width, camera.height, camera.lens, camera.pose});
  Errors errors;
  for (int n = 0; n < frames; n++) {
    const double time = n / 15.0;
    const auto sights = detector.look(grey(lights.picture(time, static_cast<uint64_t>(n))).data(), camera.width);
    const auto places = lights.places(time);
    for (int light = 0; light < path.num_lights() && n > 20; light++) {
      const auto& place = places[static_cast<size_t>(light)];
      constexpr double kBorder = 15;
      if (!place || place->x < kBorder || place->y < kBorder || place->x > camera.width - kBorder ||
          place->y > camera.height - kBorder)
        continue;
      const Sight* best = nullptr;
      for (const Sight& sight : sights)
        if (!best || glm::length(sight.pixel - *place) < glm::length(best->pixel - *place)) best = &sight;
      if (!best || glm::length(best->pixel - *place) > 3) {
        errors.missed++;
        continue;
      }
      const Vec2 e = best->pixel - *place;
      errors.squared += glm::dot(e, e), errors.normalised += glm::dot(e, e) / (best->sigma * best->sigma);
      errors.count++;
    }
  }
  return errors;
}

TEST(LightDetector, PlacesAreAsGoodAsTheySay) {
  for (const double power : {0.1, 0.4, 1.0, 2.0, 4.0, 8.0}) {  // the largest are clipped
    LightsOptions options;
    options.power = power;
    LightDetector detector(320, 240);
    const Errors errors = errors_of(options, detector);
    EXPECT_GT(errors.count, 200);
    EXPECT_EQ(errors.missed, 0u) << power;
    EXPECT_LE(errors.rms(), power < 0.2 ? 0.05 : 0.03) << power;
    EXPECT_GE(errors.of_predicted(), 0.9) << power;
    EXPECT_LE(errors.of_predicted(), 1.1) << power;
    EXPECT_NEAR(detector.record().noise, 3, 0.3);
  }
}

TEST(LightDetector, LongExposuresAndLargeLightsAreNoWorse) {
  LightsOptions options;
  options.exposure = 1.0 / 30;
  LightDetector blurred(320, 240);
  EXPECT_LE(errors_of(options, blurred).rms(), 0.03);
  options.radius = 0.015, options.power = 10;
  LightDetector large(320, 240);
  EXPECT_LE(errors_of(options, large).rms(), 0.03);
}

TEST(LightDetector, FaintLightsAreFoundInNoise) {
  LightsOptions options;
  options.power = 0.05, options.noise = 5;
  LightDetector detector(320, 240);
  const Errors errors = errors_of(options, detector);
  EXPECT_LE(static_cast<double>(errors.missed), 0.02 * errors.count);
  EXPECT_LE(errors.rms(), 0.15);
}

// Black is clipped: half of the noise is not seen, and must not be taken for lights.
TEST(LightDetector, ABlackRoomHasNoLights) {
  LightsOptions options;
  options.ambient = 0, options.bar = 0;
  const Rig rig = scene_rig(1, 2);
  const LightsCamera lights(LightsPath(rig, options), {320, 240, rig.cameras[0].lens, rig.cameras[0].pose});
  LightDetector detector(320, 240);
  size_t most = 0;
  for (int n = 0; n < 60; n++)
    most = std::max(most, detector.look(grey(lights.picture(n / 30.0, static_cast<uint64_t>(n))).data(), 320).size());
  EXPECT_EQ(most, 1u);
}

TEST(LightDetector, ReflectionsAreFoundBesideTheLights) {
  LightsOptions options;
  options.reflection = 0.6;
  LightDetector detector(320, 240);
  EXPECT_EQ(errors_of(options, detector).missed, 0u);
  std::vector<Sight> sights;
  const Rig rig = scene_rig(3, 3);
  const LightsCamera lights(LightsPath(rig, options), {320, 240, rig.cameras[4].lens, rig.cameras[4].pose});
  for (int n = 0; n < 3; n++) sights = detector.look(grey(lights.picture(n / 30.0, 7)).data(), 320);
  ASSERT_EQ(sights.size(), 4u);
  for (const Sight& sight : sights) EXPECT_GE(sights[0].brightness, sight.brightness);
}

// A picture of noise-free squares.
std::vector<uint8_t> squares(std::initializer_list<std::pair<int, int>> places, int side = 4, uint8_t level = 10) {
  std::vector<uint8_t> picture(320 * 240, level);
  for (const auto& [left, top] : places)
    for (int y = top; y < top + side; y++)
      for (int x = left; x < left + side; x++) picture[static_cast<size_t>(y * 320 + x)] = 200;
  return picture;
}

TEST(LightDetector, WhatStandsThereFromTheBeginningIsBackground) {
  LightDetector detector(320, 240);
  for (int n = 0; n < 10; n++) {
    const auto sights = detector.look(squares({{200, 50}, {40 + 5 * n, 100}}).data(), 320);
    if (n == 0) {
      EXPECT_TRUE(sights.empty());
      continue;
    }
    ASSERT_EQ(sights.size(), 1u) << n;
    EXPECT_NEAR(sights[0].pixel.x, 41.5 + 5 * n, 0.03);
    EXPECT_NEAR(sights[0].pixel.y, 101.5, 0.03);
  }
  EXPECT_EQ(detector.record().lit, 9u);
}

TEST(LightDetector, ALampAtTheBorderHasNoPlace) {
  LightDetector detector(320, 240);
  detector.look(squares({}).data(), 320);
  EXPECT_TRUE(detector.look(squares({{0, 100}}).data(), 320).empty());
}

TEST(LightDetector, APictureThatChangesAllOverIsBusy) {
  LightDetector detector(320, 240);
  detector.look(squares({}).data(), 320);
  EXPECT_TRUE(detector.look(squares({{50, 50}}, 120).data(), 320).empty());
  EXPECT_EQ(detector.record().busy, 1u);
  EXPECT_EQ(detector.record().lit, 0u);
}

TEST(LightDetector, SizesThatNoPictureHasAreRefused) { EXPECT_ERROR(LightDetector(4, 240), "can't be searched"); }

}  // namespace
}  // namespace lf
