// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/initial_layout.h"

#include <gtest/gtest.h>

#include "calibration/position_errors.h"
#include "calibration/reconstruction.h"
#include "calibration/simulator.h"

namespace lf {

// Arrays; rigs of other shapes are in pairs_layout_test.cc, single cameras in resection_test.cc.

namespace {

class InitialLayoutTest : public testing::Test {
 protected:
  Reconstruction watch(double bar, double outliers) {
    sim::PathOptions path;
    path.bar = bar;
    path.outliers = outliers;
    tracks_ = sim::watch(truth_, path, 2).tracks;
    Reconstruction scene = make_scene(tracks_, {});
    for (CameraState& camera : scene.cameras) camera.lens_terms()[kF] = 420;
    scene.batch_mean[kF] = 420;
    return scene;
  }
  // Root mean square across the array, of the pitch, by the best similarity.
  double error(const Reconstruction& scene) {
    return sim::root_mean_square(sim::position_errors(scene, truth_), [](const Vec3& e) { return Vec2(e); }) / 0.06;
  }

  const Rig truth_ = sim::make_array({.rows = 4, .columns = 4}, 1);
  Tracks tracks_;
};

TEST_F(InitialLayoutTest, DisparitiesPlaceAnArray) {
  Reconstruction scene = watch(0, 0);
  EXPECT_GT(layout_from_disparities(scene, tracks_), 0.8);
  for (const CameraState& camera : scene.cameras) EXPECT_TRUE(camera.used);
  EXPECT_LT(error(scene), 0.3);
  size_t placed = 0;
  for (const TargetState& target : scene.targets) placed += target.kind == TargetState::Kind::kPoint;
  EXPECT_GT(placed, scene.targets.size() * 8 / 10);
}

TEST_F(InitialLayoutTest, OutliersLowerTheShareThatFits) {
  Reconstruction clean = watch(0, 0);
  const double all = layout_from_disparities(clean, tracks_);
  Reconstruction dirty = watch(0, 0.2);
  const double some = layout_from_disparities(dirty, tracks_);
  EXPECT_LT(some, all - 0.1);
  EXPECT_LT(error(dirty), 0.4);
}

// A camera that sees other lights than everybody else is not placed.
TEST_F(InitialLayoutTest, StrangersAreLeftOut) {
  Reconstruction scene = watch(0, 0);
  std::mt19937_64 random(3);
  for (Observation& o : tracks_.observations)
    if (o.camera == 5)
      o.pixel = {std::uniform_real_distribution<>(0, 319)(random), std::uniform_real_distribution<>(0, 239)(random)};
  layout_from_disparities(scene, tracks_);
  EXPECT_FALSE(scene.cameras[5].used);
  EXPECT_TRUE(scene.cameras[6].used);
}

TEST_F(InitialLayoutTest, BarsAreTheUnitOfLength) {
  Reconstruction scene = watch(0.3, 0);
  for (size_t i = 0; i < scene.cameras.size(); i++) {
    scene.cameras[i].set_pose(truth_.cameras[i].pose);
    scene.cameras[i].set_lens(truth_.cameras[i].lens);
    scene.cameras[i].used = true;
  }
  targets_from_poses(scene, tracks_, 2);
  const double apart = glm::distance(scene.cameras[0].pose().position, scene.cameras[15].pose().position);
  const double metres = glm::distance(truth_.cameras[0].pose.position, truth_.cameras[15].pose.position);
  EXPECT_NEAR(apart, metres / 0.3, 0.02 * apart);
  size_t bars = 0;
  for (const TargetState& target : scene.targets) bars += target.kind == TargetState::Kind::kBar;
  EXPECT_GT(bars, scene.targets.size() / 2);
}

class ResectionTest : public testing::Test {
 protected:
  // All but camera 5 are where they are; a quarter of what it saw is mistaken.
  void SetUp() override {
    sim::ArrayOptions array;
    array.rows = array.columns = 3;
    truth_ = sim::make_array(array, 1);
    sim::PathOptions path;
    path.outliers = 0.25;
    watched_ = sim::watch(truth_, path, 2);
    scene_ = sim::true_scene(truth_, watched_, {});
    scene_.cameras[5].used = false;
    scene_.cameras[5].set_pose({{9, 9, 9}, {1, 0, 0, 0}});
  }
  Rig truth_;
  sim::Watched watched_;
  Reconstruction scene_;
};

TEST_F(ResectionTest, ACameraFromWhatItSees) {
  EXPECT_EQ(resect_cameras(scene_, watched_.tracks, 2), 1);
  EXPECT_TRUE(scene_.cameras[5].used);
  EXPECT_LE(glm::length(scene_.cameras[5].pose().position - truth_.cameras[5].pose.position), 0.01);
  EXPECT_EQ(resect_cameras(scene_, watched_.tracks, 2), 0) << "all are placed";
}

TEST_F(ResectionTest, WhateverTheUnitOfLength) {
  for (const double unit : {1e-3, 1e4}) {
    Reconstruction scaled = scene_;
    for (CameraState& camera : scaled.cameras)
      for (int i = 4; i < 7; i++) camera.v[i] *= unit;
    for (TargetState& target : scaled.targets)
      for (int i = 0; i < 3; i++) target.v[i] *= unit;
    ASSERT_EQ(resect_cameras(scaled, watched_.tracks, 2), 1) << unit;
    EXPECT_LE(glm::length(scaled.cameras[5].pose().position / unit - truth_.cameras[5].pose.position), 0.01) << unit;
  }
}

TEST_F(ResectionTest, NotFromAnotherCamerasTracks) {
  for (Observation& o : watched_.tracks.observations)
    if (o.camera == 5) o.position = (o.position + 7) % 100;
  EXPECT_EQ(resect_cameras(scene_, watched_.tracks, 2), 0);
  EXPECT_FALSE(scene_.cameras[5].used);
}

TEST_F(ResectionTest, NotFromAPointOrFromFew) {
  Reconstruction at_one = scene_;
  for (TargetState& target : at_one.targets) target.v = {0, 0, 1};
  EXPECT_EQ(resect_cameras(at_one, watched_.tracks, 2), 0);
  std::erase_if(watched_.tracks.observations, [](const Observation& o) { return o.camera == 5 && o.position > 5; });
  EXPECT_EQ(resect_cameras(scene_, watched_.tracks, 2), 0);
}

}  // namespace

}  // namespace lf
