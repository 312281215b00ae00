// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/triangulation.h"

#include <gtest/gtest.h>

#include "calibration/noise.h"
#include "calibration/simulator.h"

namespace lf {
namespace {

TEST(Triangulation, FindsTheTargetsAmongMistakes) {
  const Rig truth = sim::make_array({}, 1);
  sim::PathOptions path;
  path.outliers = 0.3, path.noise = 0;
  const sim::Watched watched = sim::watch(truth, path, 2);
  const Reconstruction expected = sim::true_scene(truth, watched, {});
  Reconstruction scene = expected;
  scene.targets.assign(scene.targets.size(), {});
  triangulate_targets(scene, watched.tracks, 4);
  for (size_t j = 0; j < scene.targets.size(); j++) {
    ASSERT_TRUE(scene.targets[j].has(0)) << j;
    EXPECT_LE(glm::length(scene.targets[j].point(0) - expected.targets[j].point(0)), 2e-3) << j;
  }
}

TEST(Triangulation, BarsAreOfUnitLength) {
  const Rig truth = sim::make_array({}, 1);
  sim::PathOptions path;
  path.bar = 0.3, path.noise = 0;
  const sim::Watched watched = sim::watch(truth, path, 2);
  Reconstruction scene = sim::true_scene(truth, watched, {});
  scene.targets.assign(scene.targets.size(), {});
  triangulate_targets(scene, watched.tracks, 4);
  EXPECT_LE(robust_sigma(residual_lengths(scene, watched.tracks.observations)), 1e-6);
  for (const TargetState& target : scene.targets)
    if (target.kind == TargetState::Kind::kBar) {
      EXPECT_NEAR(glm::length(target.point(1) - target.point(0)), 1, 1e-9);
    }
}

TEST(Triangulation, OneSightIsNotEnough) {
  const Rig truth = sim::make_array({}, 1);
  const sim::Watched watched = sim::watch(truth, {}, 2);
  const Reconstruction scene = sim::true_scene(truth, watched, {});
  EXPECT_FALSE(triangulate(scene.cameras, watched.tracks, {0}, 4));
  EXPECT_FALSE(triangulate(scene.cameras, watched.tracks, {}, 4));
}

}  // namespace
}  // namespace lf
