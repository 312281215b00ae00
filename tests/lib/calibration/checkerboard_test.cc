// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/checkerboard.h"

#include <cmath>

#include <gtest/gtest.h>

#include "support/board_views.h"

namespace lf {
namespace {

TEST(Checkerboard, FindsCornersToAFractionOfAPixel) {
  const Lens lens(LensModel::kRadial, {420, 319.5, 239.5, -0.2, 0.05});
  std::mt19937 random(3);
  const Pose pose = board_pose(random, 0.6);
  const auto found = find_checkerboard(picture_of_board(lens, pose, 640, 480, is_white_on_checkerboard), kTestBoard);
  ASSERT_TRUE(found);
  double worst = 0;
  for (size_t i = 0; i < found->size(); i++) {
    const Vec2 truth = *lens.project(pose.world_from_camera(Vec3(kTestBoard.corner(i), 0)));
    // The board looks the same after half a turn: OpenCV may count from the other end.
    const double other = glm::length(found->at(found->size() - 1 - i) - truth);
    worst = std::max(worst, std::min(glm::length(found->at(i) - truth), other));
  }
  EXPECT_LT(worst, 0.1);
}

TEST(Checkerboard, SaysWhenThereIsNone) {
  EXPECT_FALSE(find_checkerboard(Image(PixelFamily::kRgb, 320, 240), kTestBoard));
}

}  // namespace
}  // namespace lf
