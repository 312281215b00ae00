// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/relative_poses.h"

#include <gtest/gtest.h>

#include "calibration/simulator.h"

namespace lf {
namespace {

TEST(RelativePoses, NearTheTruthWhereLensesAreKnown) {
  const Rig truth = sim::make_rig_around(sim::Around::kRing, 10, 1);
  sim::PathOptions path;
  path.shape = sim::PathOptions::Shape::kBall;
  path.near = 0.5, path.missed = 0.2;
  const sim::Watched watched = sim::watch(truth, path, 2);
  const Reconstruction scene = sim::true_scene(truth, watched, {});
  const auto pairs = relative_poses(scene, watched.tracks, 1);
  EXPECT_GE(pairs.size(), 25u);
  std::vector<int> partners(10);
  int good = 0;
  for (const RelativePose& pair : pairs) {
    partners[pair.a]++, partners[pair.b]++;
    const Pose &a = truth.cameras[pair.a].pose, &b = truth.cameras[pair.b].pose;
    const Quat a_from_b = glm::conjugate(a.orientation) * b.orientation;
    const Vec3 along = glm::normalize(glm::conjugate(a.orientation) * (b.position - a.position));
    good += angle_of(a_from_b * glm::conjugate(pair.a_from_b.orientation)) < 0.1 &&
            glm::length(along - pair.a_from_b.position) < 0.1;
  }
  EXPECT_GE(good, 0.9 * static_cast<double>(pairs.size())) << "of " << pairs.size();
  for (const int n : partners) EXPECT_GE(n, 4);
}

}  // namespace
}  // namespace lf
