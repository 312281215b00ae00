// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/light_coverage.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "scene/lights.h"
#include "support/expect_error.h"

namespace lf {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

TEST(PicturePlaces, WhatIsMissingIsNamedOnce) {
  PicturePlaces places(320, 240);
  EXPECT_EQ(places.share(), 0);
  EXPECT_EQ(listed(places.gaps()), "upper left, upper right, middle left, middle right, lower left, lower right");
  for (const double y : {20.0, 120.0, 239.0})
    for (const double x : {-3.0, 100.0, 200.0, 322.0})
      if (!(x == 100 && y == 20) && !(x > 150 && y > 200)) places.come({x, y});
  EXPECT_EQ(places.share(), 9.0 / 12);
  EXPECT_FALSE(places.has(1, 0));
  EXPECT_TRUE(places.has(0, 0)) << "outside counts as the border";
  EXPECT_EQ(listed(places.gaps()), "upper left, lower right");
  EXPECT_EQ(places.gaps()[0].places, 1);
  EXPECT_EQ(places.gaps()[1].places, 2);
}

// Four cameras in a square, 0.3 m apart, 320x240.
Rig array() { return make_grid_rig({2, 2, 0.3, 40, 320, 240}); }

// A light at places of the world that all cameras look at in turn, as one thread does, while it goes on.
class Film {
 public:
  explicit Film(const Rig& rig, int lights = 1) : rig_(rig), coverage(rig, lights) {}
  // All cameras, one after the other, from `from` on to `to`.
  void show(const Vec3& from, const Vec3& to, int looks = 10, const std::vector<CameraIndex>& blind = {}) {
    for (int n = 0; n < looks; n++)
      for (CameraIndex i = 0; i < rig_.cameras.size(); i++) {
        const double t = (n + static_cast<double>(i) / static_cast<double>(rig_.cameras.size())) / looks;
        const Camera& camera = rig_.cameras[i];
        const auto pixel = camera.lens.project(camera.pose.camera_from_world(from + t * (to - from)));
        std::vector<Sight> sights;
        const bool sees = std::ranges::find(blind, i) == blind.end() && pixel && pixel->x > 0 && pixel->y > 0 &&
                          pixel->x < 320 && pixel->y < 240;
        if (sees) sights.push_back({*pixel, 0.1, 100});
        coverage.look(i, time_ + 0.2 * looks * t, sights);
      }
    time_ += 0.2 * looks;
  }

 private:
  Rig rig_;
  double time_ = 0;

 public:
  LightCoverage coverage;
};

TEST(LightCoverage, SaysWhereTheLightWasNotYet) {
  Film film(array());
  EXPECT_EQ(film.coverage.told(), "No camera has given a picture yet.");
  film.show({0, 0, 2}, {0, 0, 2}, 3, {0, 1, 2, 3});
  EXPECT_THAT(film.coverage.told(), HasSubstr("No camera has seen a light that moves yet"));
  // Along the left side of the pictures, and camera 3 is behind a curtain.
  film.show({-0.6, -0.5, 2}, {-0.6, 0.5, 2}, 20, {3});
  EXPECT_THAT(film.coverage.wanted(0), AllOf(HasSubstr("upper right"), HasSubstr("lower right")));
  EXPECT_THAT(film.coverage.told(),
              AllOf(HasSubstr("Next: "), HasSubstr("right (3 cameras)"),
                    HasSubstr("Camera 3 (cam_01_01) has seen no light."), HasSubstr("Camera 0 (cam_00_00) 25 %: ")));
  EXPECT_THAT(film.coverage.wanted(3), HasSubstr("upper left"));
}

TEST(LightCoverage, APlaneIsNotEnough) {
  Film far(array());
  far.show({-0.7, -0.5, 2}, {0.7, 0.5, 2.1}, 20);
  EXPECT_EQ(far.coverage.depth_wanted(0), "nearer");
  EXPECT_THAT(far.coverage.told(), HasSubstr("nearer (4 cameras)"));
  far.show({-0.3, -0.2, 1}, {0.3, 0.2, 1.1}, 20);
  EXPECT_EQ(far.coverage.depth_wanted(0), "");
  EXPECT_THAT(far.coverage.told(), Not(HasSubstr("nearer")));
  Film near(array());
  near.show({-0.1, -0.1, 0.6}, {0.1, 0.1, 0.6}, 20);
  EXPECT_EQ(near.coverage.depth_wanted(0), "farther");
  // An array whose cameras are two degrees off what was planned, each another way, is told the same.
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
      by_plan.look(i, 4 * t, {{*camera.lens.project(camera.pose.camera_from_world(point)), 0.1, 100}});
    }
  EXPECT_EQ(by_plan.depth_wanted(0), "nearer");
}

TEST(LightCoverage, WhereItWasEverywhereNothingIsAskedFor) {
  Film film(array());
  for (const double z : {0.9, 1.8})
    for (int row = -4; row <= 4; row++) film.show({-0.75 * z, row * 0.11 * z, z}, {0.75 * z, row * 0.11 * z, z}, 40);
  for (CameraIndex i = 0; i < 4; i++) EXPECT_EQ(film.coverage.wanted(i), "") << i;
  EXPECT_EQ(film.coverage.told(), "The light came to 100 % of the pictures. It was everywhere, near and far.");
}

// The moved bar of the built-in scene, as a detector sees it in small pictures of half the size.
TEST(LightCoverage, ABarIsFollowedBySmallPictures) {
  const Rig rig = array();
  const LightsPath path(rig, {});
  LightCoverage coverage(rig, 2);
  std::vector<LightsCamera> lights;
  std::vector<LightDetector> detectors;
  for (const Camera& camera : rig.cameras) {
    lights.emplace_back(path, SceneCamera{camera.width, camera.height, camera.lens, camera.pose});
    detectors.emplace_back(160, 120);
  }
  std::vector<PicturePlaces> truth(4, PicturePlaces(320, 240));
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
      std::vector<Sight> sights = detectors[i].look(small.data(), 160);
      for (Sight& sight : sights) sight.pixel = 2.0 * sight.pixel + Vec2(0.5, 0.5);
      coverage.look(i, time, sights);
      for (const auto& place : lights[i].places(time))
        if (place) truth[i].come(*place);
    }
  for (CameraIndex i = 0; i < 4; i++) {
    EXPECT_NEAR(coverage.places(i).share(), truth[i].share(), 1.5 / 12) << i;
    EXPECT_GE(truth[i].share(), 0.7);
    EXPECT_EQ(coverage.depth_wanted(i), "") << "it was moved between 0.8 and 2 m";
  }
}

TEST(LightCoverage, NoLightsAreRefused) { EXPECT_ERROR(LightCoverage(array(), 0), "lights: must be one at least"); }

}  // namespace
}  // namespace lf
