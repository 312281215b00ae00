// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/board_detection.h"

#include <opencv2/aruco.hpp>
#include <opencv2/imgproc.hpp>

#include "calibration/intrinsics.h"
#include "support/board_views.h"
#include "support/expect_error.h"
#include "support/printed_boards.h"
#include "support/test.h"

namespace lf {
namespace {

using Kind = CalibrationBoard::Kind;

constexpr double kTolerance = 0.3;  // pixels, for the worst corner of a rendered board

const Lens kLens(LensModel::kRadial, {620, 319.5, 239.5, -0.2, 0.05});
const CalibrationBoard kCheckerboard{.columns = 8, .rows = 5, .square = 0.03};
const CalibrationBoard kCharuco{
    .columns = 8, .rows = 5, .square = 0.03, .kind = Kind::kCharuco, .dictionary = "5X5_100", .marker = 0.7};
const CalibrationBoard kAprilGrid{.columns = 5, .rows = 4, .square = 0.045, .kind = Kind::kAprilGrid, .gap = 0.3};

CalibrationBoard legacy(CalibrationBoard board) {
  board.legacy = true;
  return board;
}

// The middle of the board at `at`, turned about its axes.
Pose pose_of(const CalibrationBoard& board, const Vec3& at, double pitch, double yaw, double roll) {
  const Quat turn =
      glm::angleAxis(pitch, Vec3(1, 0, 0)) * glm::angleAxis(yaw, Vec3(0, 1, 0)) * glm::angleAxis(roll, Vec3(0, 0, 1));
  const Vec2 middle = board.corner(board.num_corners() - 1) / 2.0;
  return {at - glm::mat3_cast(turn) * Vec3(middle, 0), turn};
}

Image picture_of(const CalibrationBoard& board, const Pose& pose) {
  static const test::PrintCamera camera(kLens, 640, 480);
  return camera.photograph(test::print_of(board), board.square, pose);
}

double worst_error(const CalibrationBoard& board, const BoardView& view, const Pose& pose) {
  double worst = 0;
  for (size_t i = 0; i < view.corners.size(); i++) {
    const Vec2 truth = *kLens.project(pose.world_from_camera(Vec3(board.corner(view.id(i)), 0)));
    worst = std::max(worst, glm::length(view.corners[i] - truth));
  }
  return worst;
}

TEST(FindBoard, NumbersAllCornersOfEachKind) {
  for (const CalibrationBoard& board : {kCheckerboard, kCharuco, legacy(kCharuco), kAprilGrid}) {
    for (const double roll : {0.1, -2.9}) {
      const Pose pose = pose_of(board, {0.02, -0.01, 0.45}, 0.3, -0.4, roll);
      const auto view = find_board(picture_of(board, pose), board);
      ASSERT_TRUE(view) << board.name() << ", roll " << roll;
      EXPECT_EQ(view->corners.size(), board.num_corners()) << board.name() << ", roll " << roll;
      EXPECT_LT(worst_error(board, *view, pose), kTolerance) << board.name() << ", roll " << roll;
    }
  }
}

// The first code of the family 36h11, row by row; 1 is white.
TEST(FindBoard, AprilTagsAreUpright) {
  constexpr uint64_t kFirstCode = 0xd5d628584;
  cv::Mat tag(10, 10, CV_8U);
  test::draw_marker(tag, cv::aruco::DICT_APRILTAG_36h11, 0, {0, 0, 10, 10}, 2, true);
  for (int i = 0; i < 36; i++)
    EXPECT_EQ(tag.at<uint8_t>(2 + i / 6, 2 + i % 6) > 127, ((kFirstCode >> (35 - i)) & 1) != 0) << i;
}

TEST(FindBoard, FindsInvertedCharuco) {
  CalibrationBoard board = kCharuco;
  board.inverted = true;
  const Pose pose = pose_of(board, {0, 0, 0.45}, 0.3, 0.2, 0.1);
  const Image picture = picture_of(board, pose);
  const auto view = find_board(picture, board);
  ASSERT_TRUE(view);
  EXPECT_EQ(view->corners.size(), board.num_corners());
  EXPECT_LT(worst_error(board, *view, pose), kTolerance);
  BoardMiss miss;
  EXPECT_FALSE(find_board(picture, kCharuco, &miss));
  EXPECT_EQ(miss, BoardMiss::kNothing);
}

TEST(FindBoard, MarkersIdentifyPartsOfABoard) {
  for (const CalibrationBoard& board : {kCharuco, legacy(kCharuco), kAprilGrid}) {
    const Pose pose = pose_of(board, {-0.13, -0.07, 0.4}, 0.2, 0.3, 0.1);
    const auto view = find_board(picture_of(board, pose), board);
    ASSERT_TRUE(view) << board.name();
    EXPECT_GT(view->corners.size(), 9u) << board.name();
    EXPECT_LT(view->corners.size(), board.num_corners()) << board.name();
    EXPECT_LT(worst_error(board, *view, pose), kTolerance) << board.name();
  }
}

TEST(FindBoard, FindsBlurredBoards) {
  for (const CalibrationBoard& board : {kCheckerboard, kCharuco, legacy(kCharuco), kAprilGrid}) {
    const Pose pose = pose_of(board, {0.02, -0.01, 0.42}, 0.3, -0.3, 0.2);
    Image picture = picture_of(board, pose);
    cv::Mat pixels(picture.height(), picture.width(), CV_8UC3, picture.data().data());
    cv::GaussianBlur(pixels, pixels, {}, 1.2);
    const auto view = find_board(picture, board);
    ASSERT_TRUE(view) << board.name();
    EXPECT_GE(2 * view->corners.size(), board.num_corners()) << board.name();
    EXPECT_LT(worst_error(board, *view, pose), 0.35) << board.name();
  }
}

TEST(FindBoard, ReturnsNothingWithoutABoard) {
  for (const CalibrationBoard& board : {kCheckerboard, kCharuco, kAprilGrid}) {
    BoardMiss miss = BoardMiss::kPartial;
    EXPECT_FALSE(find_board(Image(PixelFamily::kRgb, 320, 240), board, &miss));
    EXPECT_EQ(miss, BoardMiss::kNothing);
  }
}

// Markers at other places than described would silently shift corners.
TEST(FindBoard, DetectsWrongDescriptions) {
  const auto expect_other = [](const CalibrationBoard& printed, const CalibrationBoard& described) {
    BoardMiss miss = BoardMiss::kNothing;
    EXPECT_FALSE(find_board(picture_of(printed, pose_of(printed, {0, 0, 0.45}, 0.2, 0.2, 0.1)), described, &miss))
        << described.name();
    EXPECT_EQ(miss, BoardMiss::kOtherBoard) << described.name();
  };
  // If the number of columns is odd, the other layout only shifts all corners by one square.
  CalibrationBoard even = kCharuco;
  even.columns = 7;
  expect_other(even, legacy(even));
  expect_other(legacy(even), even);
  expect_other(kCharuco, even);
  CalibrationBoard tags = kAprilGrid;
  tags.columns = 4, tags.rows = 5;
  expect_other(kAprilGrid, tags);
}

// With an odd number of rows of squares, both layouts are the same.
TEST(FindBoard, LayoutsOfOddRowsAreEqual) {
  CalibrationBoard board = kCharuco;
  board.rows = 6;
  const Pose pose = pose_of(board, {0, 0, 0.5}, 0.2, 0.1, 0.1);
  const Image picture = picture_of(board, pose);
  for (const CalibrationBoard& description : {board, legacy(board)}) {
    const auto view = find_board(picture, description);
    ASSERT_TRUE(view);
    EXPECT_LT(worst_error(board, *view, pose), kTolerance);
  }
}

TEST(FindBoard, PartialBoardsCalibrateALens) {
  std::mt19937 random(4);
  std::vector<BoardView> views;
  size_t parts = 0;
  for (int i = 0; i < 10; i++) {
    std::uniform_real_distribution<double> uniform(-1, 1);
    const Pose pose = pose_of(kCharuco, Vec3(0.06 * uniform(random), 0.05 * uniform(random), 0.26),
                              0.6 * uniform(random), 0.6 * uniform(random), uniform(random));
    if (auto view = find_board(picture_of(kCharuco, pose), kCharuco)) {
      parts += view->corners.size() < kCharuco.num_corners();
      views.push_back(std::move(*view));
    }
  }
  ASSERT_GE(views.size(), 8u);
  EXPECT_GE(parts, 3u);
  const IntrinsicsResult result = calibrate_intrinsics(views, kCharuco, 640, 480);
  EXPECT_LT(result.fit.rms, 0.15);
  EXPECT_FALSE(result.fit.model.free_board);
  EXPECT_NEAR(result.fit.lens.fx(), 620, 1);
  EXPECT_NEAR(result.fit.lens.cx(), 319.5, 0.5);
  EXPECT_NEAR(result.fit.lens.cy(), 239.5, 0.5);
  EXPECT_NEAR(result.fit.lens.k1(), -0.2, 0.01);
}

TEST(CheckBoard, ImpossibleBoardsAreErrors) {
  CalibrationBoard board = kCharuco;
  board.dictionary = "5X5";
  EXPECT_ERROR(check_board(board), "5X5", "4X4_50");
  board = kCharuco;
  board.dictionary = "5X5_50", board.columns = 12, board.rows = 10;
  EXPECT_ERROR(check_board(board), "50 markers", "71");
  board = kCharuco;
  board.marker = 1;
  EXPECT_ERROR(check_board(board), "smaller", "squares");
  board = kAprilGrid;
  board.columns = 30, board.rows = 20;
  EXPECT_ERROR(check_board(board), "36h11", "587 markers", "600");
  EXPECT_ERROR(check_board({.columns = 2, .rows = 6}), "2x6", "from 3");
  EXPECT_ERROR(check_board({.columns = 9, .rows = 6, .square = 0}), "positive size");
}

TEST(CalibrationBoard, KnowsWhichBoardsLookTheSameAfterHalfATurn) {
  EXPECT_TRUE(kTestBoard.is_symmetric());
  EXPECT_FALSE(kCheckerboard.is_symmetric());
  EXPECT_FALSE(kCharuco.is_symmetric());
}

}  // namespace
}  // namespace lf
