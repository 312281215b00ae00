// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/checkerboard.h"

#include <cmath>

#include <gtest/gtest.h>

#include "support/board_views.h"

namespace lf {
namespace {

// White outside of the board, as paper is; 4x4 samples a pixel.
Image picture_of_board(const Lens& lens, const Pose& pose, int width, int height) {
  constexpr int kSamples = 4;
  Image image(PixelFamily::kRgb, width, height);
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++) {
      int white = 0;
      for (int s = 0; s < kSamples * kSamples; s++) {
        const Vec2 pixel(x + (s % kSamples + 0.5) / kSamples - 0.5, y + (s / kSamples + 0.5) / kSamples - 0.5);
        const Vec3 ray = pose.rotation()[2], direction(*lens.unproject(pixel), 1);
        const double t = glm::dot(ray, pose.position) / glm::dot(ray, direction);
        const Vec3 on_board = pose.camera_from_world(direction * t) / kTestBoard.square;
        const int column = static_cast<int>(std::floor(on_board.x)), row = static_cast<int>(std::floor(on_board.y));
        const bool outside = column < -1 || row < -1 || column >= kTestBoard.columns || row >= kTestBoard.rows;
        white += outside || (column + row) % 2 != 0;
      }
      const auto value = static_cast<uint8_t>(30 + 200 * white / (kSamples * kSamples));
      for (int c = 0; c < 3; c++) image.pixel(x, y)[c] = value;
    }
  return image;
}

TEST(Checkerboard, FindsCornersToAFractionOfAPixel) {
  const Lens lens(LensModel::kRadial, {420, 319.5, 239.5, -0.2, 0.05});
  std::mt19937 random(3);
  const Pose pose = board_pose(random, 0.6);
  const auto found = find_checkerboard(picture_of_board(lens, pose, 640, 480), kTestBoard);
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
