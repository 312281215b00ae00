// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gtest/gtest.h>

#include "calibration/initial_layout.h"
#include "calibration/simulator.h"

namespace lf {
namespace {

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
