// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/adjustment.h"

#include <gtest/gtest.h>

#include "calibration/simulator.h"

namespace lf {
namespace {

std::vector<Pose> poses_of(const Rig& rig) {
  std::vector<Pose> poses;
  for (const Camera& camera : rig.cameras) poses.push_back(camera.pose);
  return poses;
}

Similarity some_similarity(const Vec3& translation) {
  return {3.5, glm::angleAxis(2.0, glm::normalize(Vec3(1, -2, 0.5))), translation};
}

void expect_found(const std::vector<Pose>& a, const Similarity& truth, double tolerance) {
  std::vector<Pose> b;
  for (const Pose& pose : a) b.push_back(truth(pose));
  const Similarity found = align(a, b);
  EXPECT_NEAR(found.scale, truth.scale, tolerance);
  for (size_t i = 0; i < a.size(); i++) {
    EXPECT_LE(glm::length(found(a[i]).position - b[i].position), tolerance);
    EXPECT_GE(std::abs(glm::dot(found(a[i]).orientation, b[i].orientation)), 1 - tolerance);
  }
}

TEST(Alignment, FindsASimilarity) { expect_found(poses_of(sim::make_array({}, 1)), some_similarity({5, 6, 7}), 1e-9); }

TEST(Alignment, OrientationsDecideForOneRow) {
  sim::ArrayOptions row;
  row.rows = 1, row.position_jitter = 0;
  expect_found(poses_of(sim::make_array(row, 1)), some_similarity({0, 0, 1}), 1e-6);
}

TEST(Alignment, FarFromTheOriginNothingIsLost) {
  expect_found(poses_of(sim::make_array({}, 1)), some_similarity({1e4, 0, -1e4}), 1e-8);
}

TEST(Alignment, ScaleStaysWhereItIsFixed) {
  const std::vector<Pose> a = poses_of(sim::make_array({}, 1));
  std::vector<Pose> b;
  for (const Pose& pose : a) b.push_back(some_similarity({0, 0, 0})(pose));
  EXPECT_EQ(align(a, b, true).scale, 1);
}

}  // namespace
}  // namespace lf
