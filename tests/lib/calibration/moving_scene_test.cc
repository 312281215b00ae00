// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/moving_scene.h"

#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calibration/diagnosis.h"
#include "calibration/simulator.h"

namespace lf {
namespace {

struct Case {
  double moving = 0;      // share of the points
  double speed = 0;       // metres a second
  double late = 0.015;    // seconds, one sigma of the pictures' times
  bool other_k1 = false;  // lenses that the solver does not model
  bool wrong_camera = false;
};

MovingScene motion_in(const Case& how, uint64_t seed, std::vector<Finding>* findings = nullptr) {
  sim::ArrayOptions array;
  array.rows = array.columns = 4;
  if (how.other_k1) array.k2_spread = 0.1;
  const Rig truth = sim::make_array(array, seed);
  sim::PathOptions path;
  path.positions = 300, path.noise = 0.1;
  sim::Watched watched = sim::watch(truth, path, seed + 1);
  watched.tracks.ordered = false;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> late(truth.cameras.size());
  for (double& t : late) t = how.late * normal(random);
  std::vector<Vec3> velocity(watched.lights.size(), Vec3(0));
  for (size_t j = 0; j < velocity.size(); j++)
    if (static_cast<double>(j) < how.moving * static_cast<double>(velocity.size()))
      velocity[j] = how.speed * Vec3(normal(random), normal(random), normal(random));
  for (Observation& o : watched.tracks.observations) {
    const Camera& camera = truth.cameras[o.camera];
    const Vec3 at = watched.lights[o.position], then = at + velocity[o.position] * late[o.camera];
    o.pixel += *camera.lens.project(camera.pose.camera_from_world(then)) -
               *camera.lens.project(camera.pose.camera_from_world(at));
    if (how.wrong_camera && o.camera == 5) o.pixel.x += 2 * normal(random);
  }
  SolveOptions options;
  sim::measure_lenses(truth, {}, seed + 2, options);
  if (how.other_k1) options.distortion = DistortionModel{1, true}, options.prior_covariances.clear();
  const Solution solution = solve_tracks(watched.tracks, options);
  if (findings)
    *findings = diagnose(solution, watched.tracks, options, place_solution(solution, watched.tracks, options, {}));
  return find_motion(solution, watched.tracks);
}

TEST(MovingScene, WhatStandsStillIsNotSaidToMove) {
  for (uint64_t seed = 1; seed <= 2; seed++) {
    EXPECT_LE(motion_in({}, seed).share, 0.02) << seed;
    EXPECT_LE(motion_in({.other_k1 = true}, seed).share, 0.02) << seed;
    EXPECT_LE(motion_in({.wrong_camera = true}, seed).share, 0.02) << seed;
  }
}

TEST(MovingScene, WhatMovesIsSaid) {
  for (uint64_t seed = 1; seed <= 2; seed++) {
    std::vector<Finding> findings;
    const MovingScene motion = motion_in({.moving = 0.3, .speed = 0.5}, seed, &findings);
    EXPECT_GE(motion.share, 0.15) << seed;
    EXPECT_LE(motion.share, 0.35) << seed;
    EXPECT_THAT(findings, testing::Contains(testing::Field(&Finding::code, "moving-scene"))) << seed;
  }
}

}  // namespace
}  // namespace lf
