// SPDX-License-Identifier: LGPL-2.1-or-later
// Rigs that are no array: cameras around what they see.
#include <gtest/gtest.h>

#include "calibration/initial_layout.h"
#include "calibration/position_errors.h"
#include "calibration/reconstruction.h"
#include "calibration/simulator.h"

namespace lf {
namespace {

using sim::Around;

class PairsLayoutTest : public testing::TestWithParam<std::tuple<Around, double>> {
 protected:
  PairsLayoutTest() {
    sim::PathOptions path;
    path.shape = sim::PathOptions::Shape::kBall;
    path.near = 0.5, path.bar = std::get<1>(GetParam());
    path.missed = 0.3, path.outliers = 0.1;
    tracks_ = sim::watch(truth_, path, 2).tracks;
  }
  // Root mean square, metres, by the best similarity.
  double error(const Reconstruction& scene) {
    return sim::root_mean_square(sim::position_errors(scene, truth_), [](const Vec3& e) { return e; });
  }
  Reconstruction with_lenses_about_right() {
    Reconstruction scene = make_scene(tracks_, {});
    for (CameraState& camera : scene.cameras) camera.lens_terms()[kF] = 600;
    return scene;
  }

  const Rig truth_ = sim::make_rig_around(std::get<0>(GetParam()), 14, 1);
  Tracks tracks_;
};

TEST_P(PairsLayoutTest, AveragedPairs) {
  Reconstruction scene = with_lenses_about_right();
  EXPECT_EQ(layout_from_averages(scene, tracks_, 8), 14);
  EXPECT_LE(error(scene), 0.1);
}

TEST_P(PairsLayoutTest, FromOnePair) {
  Reconstruction scene = with_lenses_about_right();
  EXPECT_EQ(layout_from_a_pair(scene, tracks_, 8), 14);
  EXPECT_LE(error(scene), 0.1);
}

TEST_P(PairsLayoutTest, SolvedFromThere) {
  const Solution solution = solve_tracks(tracks_, {});
  EXPECT_EQ(solution.start, "averaged pairs");
  for (const CameraState& camera : solution.scene.cameras) EXPECT_TRUE(camera.used);
  EXPECT_LE(error(solution.scene), 0.03);
  EXPECT_NEAR(solution.sigma, 0.2, 0.02);
}

INSTANTIATE_TEST_SUITE_P(Rigs, PairsLayoutTest,
                         testing::Combine(testing::Values(Around::kRing, Around::kDome, Around::kAnywhere),
                                          testing::Values(0, 0.3)));

TEST(PairsLayout, NothingWhereCamerasShareTooLittle) {
  const Rig truth = sim::make_rig_around(Around::kRing, 4, 1);
  sim::PathOptions path;
  path.shape = sim::PathOptions::Shape::kBall;
  path.near = 0.5, path.positions = 8;
  const Tracks tracks = sim::watch(truth, path, 2).tracks;
  Reconstruction scene = make_scene(tracks, {});
  EXPECT_EQ(layout_from_averages(scene, tracks, 8), 0);
  EXPECT_EQ(layout_from_a_pair(scene, tracks, 8), 0);
}

}  // namespace
}  // namespace lf
