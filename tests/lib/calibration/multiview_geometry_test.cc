// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/multiview_geometry.h"
#include "calibration/noise.h"
#include "calibration/simulator.h"
#include "support/test.h"

namespace lf {
namespace {

TEST(Triangulation, IsRobustToOutliers) {
  const Rig truth = sim::make_array({}, 1);
  const sim::Watched watched = sim::watch(truth, {.noise = 0, .outliers = 0.3}, 2);
  const Reconstruction expected = sim::true_scene(truth, watched, {});
  Reconstruction scene = expected;
  scene.targets.assign(scene.targets.size(), {});
  triangulate_targets(scene, watched.tracks, 4);
  for (size_t j = 0; j < scene.targets.size(); j++) {
    ASSERT_TRUE(scene.targets[j].has(0)) << j;
    EXPECT_LE(glm::length(scene.targets[j].point(0) - expected.targets[j].point(0)), 2e-3) << j;
  }
}

TEST(Triangulation, BarsHaveUnitLength) {
  const Rig truth = sim::make_array({}, 1);
  const sim::Watched watched = sim::watch(truth, {.bar = 0.3, .noise = 0}, 2);
  Reconstruction scene = sim::true_scene(truth, watched, {});
  scene.targets.assign(scene.targets.size(), {});
  triangulate_targets(scene, watched.tracks, 4);
  EXPECT_LE(robust_sigma(residual_lengths(scene, watched.tracks.observations)), 1e-6);
  for (const TargetState& target : scene.targets)
    if (target.kind == TargetState::Kind::kBar) {
      EXPECT_NEAR(glm::length(target.point(1) - target.point(0)), 1, 1e-9);
    }
}

TEST(Triangulation, NeedsTwoObservations) {
  const Rig truth = sim::make_array({}, 1);
  const sim::Watched watched = sim::watch(truth, {}, 2);
  const Reconstruction scene = sim::true_scene(truth, watched, {});
  EXPECT_FALSE(triangulate(scene.cameras, watched.tracks, {0}, 4));
  EXPECT_FALSE(triangulate(scene.cameras, watched.tracks, {}, 4));
}

TEST(RelativePoses, AreAccurateForKnownLenses) {
  const Rig truth = sim::make_rig_around(sim::Around::kRing, 10, 1);
  const sim::Watched watched =
      sim::watch(truth, {.near = 0.5, .shape = sim::PathOptions::Shape::kBall, .missed = 0.2}, 2);
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

// Twelve cameras in a ring with pairs up to three apart; every fifth pair is wrong.
class RotationAveragingTest : public testing::Test {
 protected:
  static constexpr size_t kCameras = 12;
  static constexpr double kNoise = 0.01;  // radians

  RotationAveragingTest() {
    for (size_t i = 0; i < kCameras; i++) truth_.push_back(turn(2));
    for (size_t a = 0; a < kCameras; a++)
      for (size_t apart = 1; apart <= 3; apart++) {
        const size_t b = (a + apart) % kCameras;
        Quat relative = glm::conjugate(truth_[a]) * truth_[b] * turn(kNoise);
        const bool mistaken = (3 * a + apart) % 5 == 0;
        if (mistaken) relative = relative * turn(1);
        pairs_.push_back({a, b, relative, mistaken ? 2.0 : 1.0});
      }
  }
  Quat turn(double sigma) {
    const Vec3 v(normal_(random_), normal_(random_), normal_(random_));
    return glm::angleAxis(sigma * glm::length(v), glm::normalize(v));
  }
  double error(const std::vector<std::optional<Quat>>& found, size_t a, size_t b) {
    return angle_of(glm::conjugate(*found[a]) * *found[b] * glm::conjugate(glm::conjugate(truth_[a]) * truth_[b]));
  }

  std::mt19937_64 random_{1};
  std::normal_distribution<double> normal_;
  std::vector<Quat> truth_;
  std::vector<RelativeRotation> pairs_;
};

TEST_F(RotationAveragingTest, WrongPairsAreOutvoted) {
  const auto found = average_rotations(kCameras, pairs_);
  for (size_t i = 1; i < kCameras; i++) EXPECT_LE(error(found, 0, i), 3 * kNoise) << i;
}

TEST_F(RotationAveragingTest, UsesTheLargestGroup) {
  std::erase_if(pairs_, [](const RelativeRotation& pair) { return (pair.a < 4) != (pair.b < 4); });
  const auto found = average_rotations(kCameras + 1, pairs_);
  for (size_t i = 0; i <= kCameras; i++) EXPECT_EQ(found[i].has_value(), i >= 4 && i < kCameras) << i;
  EXPECT_LE(error(found, 4, 11), 0.1);
}

TEST_F(RotationAveragingTest, ReturnsNothingWithoutPairs) {
  EXPECT_EQ(average_rotations(2, {}), std::vector<std::optional<Quat>>(2));
}

TEST(Angle, OfEitherSign) {
  const Quat q = glm::angleAxis(0.3, Vec3(0, 1, 0));
  EXPECT_NEAR(angle_of(q), 0.3, 1e-12);
  EXPECT_NEAR(angle_of(-q), 0.3, 1e-12);
}

}  // namespace
}  // namespace lf
