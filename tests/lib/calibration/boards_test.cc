// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/boards.h"

#include <cmath>

#include <gtest/gtest.h>
#include <opencv2/aruco/charuco.hpp>

#include "calibration/intrinsics.h"
#include "support/board_views.h"
#include "support/expect_error.h"

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

const CharucoBoard kBoard = {kTestBoard, "5X5_100", 0.7};

// The board as OpenCV prints it, white around.
bool is_white(const Vec2& at) {
  constexpr int kSquare = 40;  // pixels of the print
  static const cv::Mat print = [] {
    cv::Mat image;
    cv::aruco::CharucoBoard::create(kTestBoard.columns + 1, kTestBoard.rows + 1, 1, 0.7F,
                                    cv::aruco::getPredefinedDictionary(cv::aruco::DICT_5X5_100))
        ->draw({kSquare * (kTestBoard.columns + 1), kSquare * (kTestBoard.rows + 1)}, image);
    return image;
  }();
  const int x = static_cast<int>(std::floor((at.x + 1) * kSquare)),
            y = static_cast<int>(std::floor((at.y + 1) * kSquare));
  return x < 0 || y < 0 || x >= print.cols || y >= print.rows || print.at<uint8_t>(y, x) > 127;
}

const Lens kLens(LensModel::kRadial, {620, 319.5, 239.5, -0.2, 0.05});

TEST(Charuco, FindsAndNamesCornersOfAPartOfTheBoard) {
  // Nearer, so that some of the board is outside of the image.
  const Pose pose{Vec3(-0.17, -0.1, 0.22), glm::angleAxis(0.3, Vec3(0.6, 0.8, 0))};
  const auto view = find_charuco(picture_of_board(kLens, pose, 640, 480, is_white), kBoard);
  ASSERT_TRUE(view);
  EXPECT_GT(view->corners.size(), 12u);
  EXPECT_LT(view->corners.size(), kTestBoard.num_corners());
  ASSERT_EQ(view->ids.size(), view->corners.size());
  for (size_t i = 0; i < view->corners.size(); i++) {
    const Vec2 truth = *kLens.project(pose.world_from_camera(Vec3(kTestBoard.corner(view->id(i)), 0)));
    EXPECT_LT(glm::length(view->corners[i] - truth), 0.25) << view->id(i);
  }
}

TEST(Charuco, PartsOfTheBoardGiveALens) {
  std::mt19937 random(4);
  std::vector<BoardView> views;
  size_t parts = 0;
  for (int i = 0; i < 10; i++) {
    Pose pose = board_pose(random, 0.6);
    pose.position *= 0.6;
    if (auto view = find_charuco(picture_of_board(kLens, pose, 640, 480, is_white), kBoard)) {
      parts += view->corners.size() < kTestBoard.num_corners();
      views.push_back(std::move(*view));
    }
  }
  ASSERT_GE(views.size(), 8u);
  EXPECT_GE(parts, 3u);
  const IntrinsicsResult result = calibrate_intrinsics(views, kTestBoard, 640, 480);
  EXPECT_LT(result.fit.rms, 0.15);
  EXPECT_FALSE(result.fit.model.free_board);
  EXPECT_NEAR(result.fit.lens.fx(), 620, 0.5);
  EXPECT_NEAR(result.fit.lens.cx(), 319.5, 0.3);
  EXPECT_NEAR(result.fit.lens.cy(), 239.5, 0.3);
  EXPECT_NEAR(result.fit.lens.k1(), -0.2, 0.005);
}

TEST(Charuco, SaysWhenThereIsNone) { EXPECT_FALSE(find_charuco(Image(PixelFamily::kRgb, 320, 240), kBoard)); }

TEST(Charuco, BoardsThatCannotBe) {
  EXPECT_ERROR(check_charuco_board({kTestBoard, "5X5", 0.7}), "no dictionary of markers 5X5: 4X4_50");
  EXPECT_ERROR(check_charuco_board({{12, 10, 1}, "5X5_50", 0.7}), "has 50 markers, the board 71");
  EXPECT_ERROR(check_charuco_board({kTestBoard, "5X5_100", 1}), "smaller than its squares");
}

BoardView at(double x, std::vector<int> ids = {0, 1, 2, 3}) {
  BoardView view{"", {}, ids};
  for (const int id : ids) view.corners.emplace_back(x + 20 * id, 100);
  return view;
}

TEST(ViewChooser, TakesABoardThatStandsStillSomewhereElse) {
  ViewChooser chooser(320);
  EXPECT_FALSE(chooser.take(at(50)));  // is it moving?
  EXPECT_TRUE(chooser.take(at(50.4)));
  EXPECT_FALSE(chooser.take(at(50.4)));  // as before
  EXPECT_FALSE(chooser.take(at(60)));    // moving
  EXPECT_FALSE(chooser.take(at(60)));    // still, but hardly elsewhere
  EXPECT_FALSE(chooser.take(at(90)));
  EXPECT_TRUE(chooser.take(at(90)));
}

TEST(ViewChooser, ComparesTheCornersThatBothShow) {
  ViewChooser chooser(320);
  EXPECT_FALSE(chooser.take(at(50)));
  EXPECT_TRUE(chooser.take(at(50)));
  EXPECT_FALSE(chooser.take(at(50, {2, 3, 4, 5})));  // the same place, another part
  EXPECT_FALSE(chooser.take(at(50, {6, 7})));        // nothing in common: is it moving?
  EXPECT_TRUE(chooser.take(at(50, {6, 7})));
}

}  // namespace

}  // namespace lf
