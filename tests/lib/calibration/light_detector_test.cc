// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/light_detector.h"
#include "scene/calibration_targets.h"
#include "support/expect_error.h"
#include "support/test.h"

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
  double rms() const { return std::sqrt(squared / (2 * count)); }              // x and y together, pixels
  double of_predicted() const { return std::sqrt(normalised / (2 * count)); }  // 1 if the sigmas are correct
};

// Errors of the lights in pictures of the centre camera of nine, without lights at the border.
Errors errors_of(const MovingLightOptions& options, LightDetector& detector, int frames = 150) {
  const Rig rig = scene_rig(3, 3);
  const LightTrajectory path(rig, options);
  const Camera& camera = rig.cameras[4];
  const MovingLightCamera lights(path, {camera.width, camera.height, camera.lens, camera.pose});
  Errors errors;
  for (int n = 0; n < frames; n++) {
    const double time = n / 15.0;
    const auto sights = detector.detect(grey(lights.picture(time, static_cast<uint64_t>(n))).data(), camera.width);
    const auto places = lights.places(time);
    for (int light = 0; light < path.num_lights() && n > 20; light++) {
      const auto& place = places[static_cast<size_t>(light)];
      constexpr double kBorder = 15;
      if (!place || place->x < kBorder || place->y < kBorder || place->x > camera.width - kBorder ||
          place->y > camera.height - kBorder)
        continue;
      const LightDetection* best = nullptr;
      for (const LightDetection& sight : sights)
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

TEST(LightDetector, PositionErrorsMatchTheSigmas) {
  for (const double power : {0.1, 0.4, 1.0, 2.0, 4.0, 8.0}) {
    LightDetector detector(320, 240);
    const Errors errors = errors_of({.power = power}, detector);
    EXPECT_GT(errors.count, 200);
    EXPECT_EQ(errors.missed, 0u) << power;
    EXPECT_LE(errors.rms(), power < 0.2 ? 0.05 : 0.03) << power;
    EXPECT_GE(errors.of_predicted(), 0.9) << power;
    EXPECT_LE(errors.of_predicted(), 1.1) << power;
    EXPECT_NEAR(detector.record().noise, 3, 0.3);
  }
}

TEST(LightDetector, IsAccurateForLongExposuresAndLargeLights) {
  LightDetector blurred(320, 240), large(320, 240);
  EXPECT_LE(errors_of({.exposure = 1.0 / 30}, blurred).rms(), 0.03);
  EXPECT_LE(errors_of({.radius = 0.015, .power = 10, .exposure = 1.0 / 30}, large).rms(), 0.03);
}

TEST(LightDetector, FaintLightsAreFoundInNoise) {
  LightDetector detector(320, 240);
  const Errors errors = errors_of({.power = 0.05, .noise = 5}, detector);
  EXPECT_LE(static_cast<double>(errors.missed), 0.02 * errors.count);
  EXPECT_LE(errors.rms(), 0.15);
}

// Black is clipped, so half of the noise is invisible; the rest must not be detected as lights.
TEST(LightDetector, FindsNoLightsInABlackRoom) {
  const Rig rig = scene_rig(1, 2);
  const LightTrajectory path(rig, {.bar = 0, .ambient = 0});
  const MovingLightCamera lights(path, {320, 240, rig.cameras[0].lens, rig.cameras[0].pose});
  LightDetector detector(320, 240);
  size_t most = 0;
  for (int n = 0; n < 60; n++)
    most = std::max(most, detector.detect(grey(lights.picture(n / 30.0, static_cast<uint64_t>(n))).data(), 320).size());
  EXPECT_EQ(most, 1u);
}

TEST(LightDetector, FindsReflectionsNearLights) {
  const MovingLightOptions options{.reflection = 0.6};
  LightDetector detector(320, 240);
  EXPECT_EQ(errors_of(options, detector).missed, 0u);
  std::vector<LightDetection> sights;
  const Rig rig = scene_rig(3, 3);
  const MovingLightCamera lights(LightTrajectory(rig, options), {320, 240, rig.cameras[4].lens, rig.cameras[4].pose});
  for (int n = 0; n < 3; n++) sights = detector.detect(grey(lights.picture(n / 30.0, 7)).data(), 320);
  ASSERT_EQ(sights.size(), 4u);
  for (const LightDetection& sight : sights) EXPECT_GE(sights[0].brightness, sight.brightness);
}

std::vector<uint8_t> squares(std::initializer_list<std::pair<int, int>> places, int side = 4, uint8_t level = 10) {
  std::vector<uint8_t> picture(320 * 240, level);
  for (const auto& [left, top] : places)
    for (int y = top; y < top + side; y++)
      for (int x = left; x < left + side; x++) picture[static_cast<size_t>(y * 320 + x)] = 200;
  return picture;
}

TEST(LightDetector, StaticLightsAreBackground) {
  LightDetector detector(320, 240);
  for (int n = 0; n < 10; n++) {
    const auto sights = detector.detect(squares({{200, 50}, {40 + 5 * n, 100}}).data(), 320);
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

TEST(LightDetector, LightsAtTheBorderAreSkipped) {
  LightDetector detector(320, 240);
  detector.detect(squares({}).data(), 320);
  EXPECT_TRUE(detector.detect(squares({{0, 100}}).data(), 320).empty());
}

TEST(LightDetector, FrameWithManyBrightPixelsIsBusy) {
  LightDetector detector(320, 240);
  detector.detect(squares({}).data(), 320);
  EXPECT_TRUE(detector.detect(squares({{50, 50}}, 120).data(), 320).empty());
  EXPECT_EQ(detector.record().busy, 1u);
  EXPECT_EQ(detector.record().lit, 0u);
}

TEST(LightDetector, InvalidSizesAreErrors) { EXPECT_ERROR(LightDetector(4, 240), "can't be searched"); }

TEST(CoverageGrid, GapsAreNamedOnce) {
  CoverageGrid places(320, 240);
  EXPECT_EQ(places.share(), 0);
  EXPECT_EQ(gap_names(places.gaps()), "upper left, upper right, middle left, middle right, lower left, lower right");
  for (const double y : {20.0, 120.0, 239.0})
    for (const double x : {-3.0, 100.0, 200.0, 322.0})
      if (!(x == 100 && y == 20) && !(x > 150 && y > 200)) places.come({x, y});
  EXPECT_EQ(places.share(), 9.0 / 12);
  EXPECT_FALSE(places.has(1, 0));
  EXPECT_TRUE(places.has(0, 0)) << "outside counts as the border";
  EXPECT_EQ(gap_names(places.gaps()), "upper left, lower right");
  EXPECT_EQ(places.gaps()[0].places, 1);
  EXPECT_EQ(places.gaps()[1].places, 2);
}

Rig array() { return make_grid_rig({2, 2, 0.3, 40, 320, 240}); }

// Shows a light at 3D positions to all cameras in turn, as one thread does during a recording.
class Film {
 public:
  explicit Film(const Rig& rig, int lights = 1) : rig_(rig), coverage(rig, lights) {}
  void show(const Vec3& from, const Vec3& to, int looks = 10, const std::vector<CameraIndex>& blind = {}) {
    for (int n = 0; n < looks; n++)
      for (CameraIndex i = 0; i < rig_.cameras.size(); i++) {
        const double t = (n + static_cast<double>(i) / static_cast<double>(rig_.cameras.size())) / looks;
        const Camera& camera = rig_.cameras[i];
        const auto pixel = camera.lens.project(camera.pose.camera_from_world(from + t * (to - from)));
        std::vector<LightDetection> sights;
        const bool sees = std::ranges::find(blind, i) == blind.end() && pixel && pixel->x > 0 && pixel->y > 0 &&
                          pixel->x < 320 && pixel->y < 240;
        if (sees) sights.push_back({*pixel, 0.1, 100});
        coverage.add_frame(i, time_ + 0.2 * looks * t, sights);
      }
    time_ += 0.2 * looks;
  }

 private:
  Rig rig_;
  double time_ = 0;

 public:
  LightCoverage coverage;
};

TEST(LightCoverage, NamesUncoveredAreas) {
  Film film(array());
  EXPECT_MENTIONS(film.coverage.summary(), "No frames");
  film.show({0, 0, 2}, {0, 0, 2}, 3, {0, 1, 2, 3});
  EXPECT_THAT(film.coverage.summary(), mentions("No camera", "light"));
  film.show({-0.6, -0.5, 2}, {-0.6, 0.5, 2}, 20, {3});
  EXPECT_THAT(film.coverage.wanted(0), AllOf(HasSubstr("upper right"), HasSubstr("lower right")));
  EXPECT_THAT(film.coverage.summary(),
              AllOf(HasSubstr("Next: "), HasSubstr("right (3 cameras)"), mentions("Camera 3", "cam_01_01", "no light"),
                    mentions("Camera 0", "cam_00_00", "25 %")));
  EXPECT_THAT(film.coverage.wanted(3), HasSubstr("upper left"));
}

TEST(LightCoverage, OnePlaneDoesNotCoverTheDepth) {
  Film far(array());
  far.show({-0.7, -0.5, 2}, {0.7, 0.5, 2.1}, 20);
  EXPECT_EQ(far.coverage.depth_wanted(0), "nearer");
  EXPECT_THAT(far.coverage.summary(), HasSubstr("nearer (4 cameras)"));
  far.show({-0.3, -0.2, 1}, {0.3, 0.2, 1.1}, 20);
  EXPECT_EQ(far.coverage.depth_wanted(0), "");
  EXPECT_THAT(far.coverage.summary(), Not(HasSubstr("nearer")));
  Film near(array());
  near.show({-0.1, -0.1, 0.6}, {0.1, 0.1, 0.6}, 20);
  EXPECT_EQ(near.coverage.depth_wanted(0), "farther");
  // An array with each camera two degrees off the plan, in different directions, gets the same result.
  const Rig planned = array();
  Rig built = planned;
  for (size_t i = 0; i < 4; i++)
    built.cameras[i].pose.orientation = quat_from_euler({i % 2 ? 1.5 : -1.5, i < 2 ? 1.0 : -1.0, 2});
  LightCoverage by_plan(planned, 1);
  for (int n = 0; n < 20; n++)
    for (CameraIndex i = 0; i < 4; i++) {
      const double t = (n + i / 4.0) / 20;
      const Camera& camera = built.cameras[i];
      const Vec3 point = Vec3(-0.3, -0.3, 2) + t * Vec3(0.6, 0.6, 0.1);
      by_plan.add_frame(i, 4 * t, {{*camera.lens.project(camera.pose.camera_from_world(point)), 0.1, 100}});
    }
  EXPECT_EQ(by_plan.depth_wanted(0), "nearer");
}

TEST(LightCoverage, FullCoverageNeedsNothing) {
  Film film(array());
  for (const double z : {0.9, 1.8})
    for (int row = -4; row <= 4; row++) film.show({-0.75 * z, row * 0.11 * z, z}, {0.75 * z, row * 0.11 * z, z}, 40);
  for (CameraIndex i = 0; i < 4; i++) EXPECT_EQ(film.coverage.wanted(i), "") << i;
  EXPECT_MENTIONS(film.coverage.summary(), "100 %", "Nothing");
}

// The detector sees the moving bar in pictures of half size.
TEST(LightCoverage, TracksABarInSmallPictures) {
  const Rig rig = array();
  const LightTrajectory path(rig, {});
  LightCoverage coverage(rig, 2);
  std::vector<MovingLightCamera> lights;
  std::vector<LightDetector> detectors;
  for (const Camera& camera : rig.cameras) {
    lights.emplace_back(path, SceneCamera{camera.width, camera.height, camera.lens, camera.pose});
    detectors.emplace_back(160, 120);
  }
  std::vector<CoverageGrid> truth(4, CoverageGrid(320, 240));
  for (int n = 0; n < 200; n++)
    for (CameraIndex i = 0; i < 4; i++) {
      const double time = 0.2 * n + 0.05 * i;
      const Image picture = lights[i].picture(time, static_cast<uint64_t>(4 * n) + i);
      std::vector<uint8_t> small(160 * 120);
      for (int y = 0; y < 120; y++)
        for (int x = 0; x < 160; x++)
          small[static_cast<size_t>(160 * y + x)] =
              static_cast<uint8_t>((picture.pixel(2 * x, 2 * y)[0] + picture.pixel(2 * x + 1, 2 * y)[0] +
                                    picture.pixel(2 * x, 2 * y + 1)[0] + picture.pixel(2 * x + 1, 2 * y + 1)[0]) /
                                   4);
      std::vector<LightDetection> sights = detectors[i].detect(small.data(), 160);
      for (LightDetection& sight : sights) sight.pixel = 2.0 * sight.pixel + Vec2(0.5, 0.5);
      coverage.add_frame(i, time, sights);
      for (const auto& place : lights[i].places(time))
        if (place) truth[i].come(*place);
    }
  for (CameraIndex i = 0; i < 4; i++) {
    EXPECT_NEAR(coverage.places(i).share(), truth[i].share(), 1.5 / 12) << i;
    EXPECT_GE(truth[i].share(), 0.7);
    EXPECT_EQ(coverage.depth_wanted(i), "") << "moved between 0.8 and 2 m";
  }
}

TEST(LightCoverage, ThrowsForZeroLights) { EXPECT_ERROR(LightCoverage(array(), 0), "lights", "1"); }

}  // namespace
}  // namespace lf
