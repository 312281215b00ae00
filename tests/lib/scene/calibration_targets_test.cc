// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/calibration_targets.h"
#include "support/expect_error.h"
#include "support/test.h"

namespace lf {
namespace {

MovingLightOptions quiet() { return {.power = 0.5, .ambient = 0, .noise = 0}; }

MovingLightCamera camera_of(const Rig& rig, const MovingLightOptions& options) {
  return {LightTrajectory(rig, options), {320, 240, rig.cameras[0].lens, rig.cameras[0].pose}};
}

Vec2 centroid(const Image& image, const Vec2& around, int reach) {
  Vec2 sum(0);
  double all = 0;
  const Vec2 middle = glm::round(around);
  for (int y = -reach; y <= reach; y++)
    for (int x = -reach; x <= reach; x++) {
      const Vec2 at = middle + Vec2(x, y);
      const double light = std::pow(*image.pixel(static_cast<int>(at.x), static_cast<int>(at.y)), 2);
      sum += light * at, all += light;
    }
  return sum / all;
}

TEST(Lights, TruthMatchesThePicture) {
  const Rig rig = scene_rig(1, 3);
  MovingLightOptions options = quiet();
  options.exposure = 1.0 / 30;
  const MovingLightCamera camera = camera_of(rig, options);
  int seen = 0;
  for (int n = 0; n < 40; n++) {
    const auto places = camera.places(n * 0.4);
    ASSERT_EQ(places.size(), 2u);
    if (places[0] && places[1] && glm::length(*places[0] - *places[1]) < 60) continue;
    const Image image = camera.picture(n * 0.4, 1);
    for (const auto& place : places) {
      if (!place || place->x < 30 || place->y < 30 || place->x > 289 || place->y > 209) continue;
      EXPECT_LE(glm::length(centroid(image, *place, 20) - *place), 0.03) << n;
      seen++;
    }
  }
  EXPECT_GT(seen, 30);
}

TEST(Lights, BarIsRigidAndHasTheRequestedSpeed) {
  const LightTrajectory path(scene_rig(2, 2), quiet());
  double sum = 0;
  constexpr int kSteps = 3000;
  for (int n = 0; n < kSteps; n++) {
    const auto now = path.lights(n * 0.02), next = path.lights(n * 0.02 + 1e-3);
    EXPECT_NEAR(glm::length(now[1] - now[0]), 0.3, 1e-9);
    for (int light = 0; light < 2; light++) sum += std::pow(glm::length(next[light] - now[light]) / 1e-3, 2) / 2;
  }
  EXPECT_NEAR(std::sqrt(sum / kSteps), 0.5, 0.05);
}

TEST(Lights, WindowReflectsThemDimmer) {
  const Rig rig = scene_rig(1, 2);
  MovingLightOptions options = quiet();
  options.bar = 0, options.reflection = 0.5;
  const MovingLightCamera camera = camera_of(rig, options);
  const auto places = camera.places(1);
  ASSERT_EQ(places.size(), 2u);
  ASSERT_TRUE(places[0] && places[1]);
  const Image image = camera.picture(1, 1);
  const auto level = [&](const Vec2& at) {
    return *image.pixel(static_cast<int>(at.x + 0.5), static_cast<int>(at.y + 0.5));
  };
  EXPECT_GT(level(*places[1]), 10);
  EXPECT_GT(level(*places[0]), level(*places[1]));
}

TEST(Lights, NoiseHasTheRequestedLevelAndSeed) {
  const Rig rig = scene_rig(1, 2);
  MovingLightOptions options = quiet();
  options.noise = 3, options.ambient = 0.2, options.bar = 0;
  const MovingLightCamera camera = camera_of(rig, options);
  const Image a = camera.picture(0, 1), b = camera.picture(0, 2);
  EXPECT_EQ(a.data(), camera.picture(0, 1).data());
  double sum = 0, count = 0;
  for (size_t i = 0; i < a.data().size(); i += 3)
    if (a.data()[i] > 20 && a.data()[i] < 235) sum += std::pow(a.data()[i] - b.data()[i], 2), count++;
  EXPECT_NEAR(std::sqrt(sum / count / 2), 3, 0.1);
}

TEST(Lights, InvalidOptionsAreErrors) {
  EXPECT_ERROR(LightTrajectory(scene_rig(1, 2), {.far = 0.5}), "far", "near");
  EXPECT_ERROR(LightTrajectory(Rig(), {}), "no cameras");
}

}  // namespace
}  // namespace lf
