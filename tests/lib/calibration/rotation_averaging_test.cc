// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/relative_poses.h"

#include <random>

#include <gtest/gtest.h>

namespace lf {
namespace {

// Twelve cameras in a ring and pairs up to three apart; every fifth pair is mistaken.
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
  // Between the same two cameras.
  double error(const std::vector<std::optional<Quat>>& found, size_t a, size_t b) {
    return angle_of(glm::conjugate(*found[a]) * *found[b] * glm::conjugate(glm::conjugate(truth_[a]) * truth_[b]));
  }

  std::mt19937_64 random_{1};
  std::normal_distribution<double> normal_;
  std::vector<Quat> truth_;
  std::vector<RelativeRotation> pairs_;
};

TEST_F(RotationAveragingTest, MistakenPairsAreOutvoted) {
  const auto found = average_rotations(kCameras, pairs_);
  for (size_t i = 1; i < kCameras; i++) EXPECT_LE(error(found, 0, i), 3 * kNoise) << i;
}

TEST_F(RotationAveragingTest, TheLargestGroupOnly) {
  std::erase_if(pairs_, [](const RelativeRotation& pair) { return (pair.a < 4) != (pair.b < 4); });
  const auto found = average_rotations(kCameras + 1, pairs_);
  for (size_t i = 0; i <= kCameras; i++) EXPECT_EQ(found[i].has_value(), i >= 4 && i < kCameras) << i;
  EXPECT_LE(error(found, 4, 11), 0.1);
}

TEST_F(RotationAveragingTest, NothingFromNothing) {
  EXPECT_EQ(average_rotations(2, {}), std::vector<std::optional<Quat>>(2));
}

TEST(Angle, OfEitherSign) {
  const Quat q = glm::angleAxis(0.3, Vec3(0, 1, 0));
  EXPECT_NEAR(angle_of(q), 0.3, 1e-12);
  EXPECT_NEAR(angle_of(-q), 0.3, 1e-12);
}

}  // namespace
}  // namespace lf
