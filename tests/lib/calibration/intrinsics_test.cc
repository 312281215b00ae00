// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <cmath>
#include <filesystem>

#include <gtest/gtest.h>
#include <opencv2/aruco/charuco.hpp>

#include "calibration/intrinsics.h"
#include "image/image.h"
#include "support/board_views.h"
#include "support/expect_error.h"
#include "support/mentions.h"

namespace lf {
namespace {

TEST(Checkerboard, FindsCornersToAFractionOfAPixel) {
  const Lens lens(LensModel::kRadial, {420, 319.5, 239.5, -0.2, 0.05});
  std::mt19937 random(3);
  const Pose pose = board_pose(random, 0.6);
  const auto found =
      find_checkerboard(picture_of_board(lens, pose, 640, 480, is_white_on_checkerboard), kTestBoard).value();
  double worst = 0;
  for (size_t i = 0; i < found.size(); i++) {
    const Vec2 truth = *lens.project(pose.world_from_camera(Vec3(kTestBoard.corner(i), 0)));
    // A half turn leaves the board unchanged: OpenCV may count from the opposite end.
    const double other = glm::length(found.at(found.size() - 1 - i) - truth);
    worst = std::max(worst, std::min(glm::length(found.at(i) - truth), other));
  }
  EXPECT_LT(worst, 0.1);
}

TEST(Checkerboard, ReturnsNothingWithoutABoard) {
  EXPECT_FALSE(find_checkerboard(Image(PixelFamily::kRgb, 320, 240), kTestBoard));
}

const CharucoBoard kBoard = {kTestBoard, "5X5_100", 0.7};

// The board as OpenCV prints it, with a white border.
bool is_white(const Vec2& at) {
  constexpr int kSquare = 40;
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

TEST(Charuco, IdentifiesCornersOfAPartialBoard) {
  const Pose pose{Vec3(-0.17, -0.1, 0.22), glm::angleAxis(0.3, Vec3(0.6, 0.8, 0))};
  const auto view = find_charuco(picture_of_board(kLens, pose, 640, 480, is_white), kBoard).value();
  EXPECT_GT(view.corners.size(), 12u);
  EXPECT_LT(view.corners.size(), kTestBoard.num_corners());
  ASSERT_EQ(view.ids.size(), view.corners.size());
  for (size_t i = 0; i < view.corners.size(); i++) {
    const Vec2 truth = *kLens.project(pose.world_from_camera(Vec3(kTestBoard.corner(view.id(i)), 0)));
    EXPECT_LT(glm::length(view.corners[i] - truth), 0.25) << view.id(i);
  }
}

TEST(Charuco, PartialBoardsCalibrateALens) {
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

TEST(Charuco, ReturnsNothingWithoutABoard) { EXPECT_FALSE(find_charuco(Image(PixelFamily::kRgb, 320, 240), kBoard)); }

TEST(Charuco, ImpossibleBoardsAreErrors) {
  EXPECT_ERROR(check_charuco_board({kTestBoard, "5X5", 0.7}), "5X5", "4X4_50");
  EXPECT_ERROR(check_charuco_board({{12, 10, 1}, "5X5_50", 0.7}), "50 markers", "71");
  EXPECT_ERROR(check_charuco_board({kTestBoard, "5X5_100", 1}), "smaller", "squares");
}

BoardView at(double x, std::vector<int> ids = {0, 1, 2, 3}) {
  BoardView view{"", {}, ids};
  for (const int id : ids) view.corners.emplace_back(x + 20 * id, 100);
  return view;
}

TEST(KeyframeSelector, SelectsStillBoardsAtNewPositions) {
  KeyframeSelector chooser(320);
  EXPECT_FALSE(chooser.take(at(50)));  // may be moving
  EXPECT_TRUE(chooser.take(at(50.4)));
  EXPECT_FALSE(chooser.take(at(50.4)));
  EXPECT_FALSE(chooser.take(at(60)));
  EXPECT_FALSE(chooser.take(at(60)));  // still, but not far enough away
  EXPECT_FALSE(chooser.take(at(90)));
  EXPECT_TRUE(chooser.take(at(90)));
}

TEST(KeyframeSelector, ComparesCommonCorners) {
  KeyframeSelector chooser(320);
  EXPECT_FALSE(chooser.take(at(50)));
  EXPECT_TRUE(chooser.take(at(50)));
  EXPECT_FALSE(chooser.take(at(50, {2, 3, 4, 5})));
  EXPECT_FALSE(chooser.take(at(50, {6, 7})));  // no common corners: may be moving
  EXPECT_TRUE(chooser.take(at(50, {6, 7})));
}

const Lens kZhangLens(LensModel::kRadial, {420, 322, 236, -0.2, 0.05});

TEST(Zhang, FindsTheTrueLens) {
  for (const bool free_board : {false, true}) {
    const ZhangFit fit =
        fit_zhang(board_views(kZhangLens, 10, 0, 1), kTestBoard, 640, 480, {LensModel::kRadial, free_board});
    EXPECT_LT(fit.rms, 1e-4) << "OpenCV keeps pixels as floats";
    for (int i = 0; i < 5; i++) EXPECT_NEAR(fit.lens.params()[i], kZhangLens.params()[i], i < 3 ? 1e-2 : 1e-4) << i;
  }
  const Lens pinhole(LensModel::kPinhole, {420, 430, 322, 236});
  const ZhangFit fit = fit_zhang(board_views(pinhole, 10, 0, 1), kTestBoard, 640, 480, {LensModel::kPinhole});
  for (int i = 0; i < 4; i++) EXPECT_NEAR(fit.lens.params()[i], pinhole.params()[i], 1e-2) << i;
}

// Errors over many seeds in units of the reported covariance: 5 degrees of freedom each.
TEST(Zhang, CovarianceMatchesTheErrors) {
  for (const bool free_board : {false, true}) {
    const int seeds = free_board ? 6 : 30;
    double sum = 0;
    for (int seed = 1; seed <= seeds; seed++) {
      const ZhangFit fit =
          fit_zhang(board_views(kZhangLens, 8, 0.1, seed), kTestBoard, 640, 480, {LensModel::kRadial, free_board});
      const double residuals = 2.0 * 8 * static_cast<double>(kTestBoard.num_corners());
      EXPECT_NEAR(fit.rms, 0.1 * std::sqrt(2 * (1 - static_cast<double>(fit.num_params) / residuals)), 0.015);
      for (int i = 0; i < 5; i++)
        sum += std::pow(fit.lens.params()[i] - kZhangLens.params()[i], 2) / fit.covariance[i * 5 + i];
    }
    EXPECT_GT(sum / (5 * seeds), 0.5) << free_board;
    EXPECT_LT(sum / (5 * seeds), 1.8) << free_board;
  }
}

TEST(Zhang, EstimatesABoardThatIsNotFlat) {
  std::vector<BoardView> views = board_views(kZhangLens, 12, 0.05, 4);
  const ZhangModel flat{LensModel::kRadial, false}, free{LensModel::kRadial, true};
  const double flat_rms = fit_zhang(views, kTestBoard, 640, 480, flat).rms;
  // A corner printed 0.3 mm off: the same shift across the board in every view, projected into the image.
  for (BoardView& view : views) {
    const Vec2 along = (view.corners[21] - view.corners[20]) / kTestBoard.square;
    view.corners[20] += along * 3e-4;
  }
  EXPECT_GT(fit_zhang(views, kTestBoard, 640, 480, flat).rms, flat_rms * 1.05);
  const ZhangFit fit = fit_zhang(views, kTestBoard, 640, 480, free);
  EXPECT_NEAR(fit.board[20].x - kTestBoard.corner(20).x, 3e-4, 1e-4);
}

TEST(Zhang, PredictsHeldOutViews) {
  const ZhangFit fit = fit_zhang(board_views(kZhangLens, 10, 0.05, 1), kTestBoard, 640, 480, {});
  EXPECT_NEAR(held_out_rms(fit, board_views(kZhangLens, 1, 0.05, 99)[0]), 0.05 * std::sqrt(2), 0.02);
}

TEST(Zhang, DegenerateViewsAreErrors) {
  EXPECT_ERROR(fit_zhang(board_views(kZhangLens, 2, 0.1, 1), kTestBoard, 640, 480, {}), "3 views");
}

TEST(Intrinsics, SelectsJustifiedTerms) {
  using enum LensModel;
  for (const Lens& lens : {Lens(kSimplePinhole, {420, 322, 236}), Lens(kSimpleRadial, {420, 322, 236, -0.1}),
                           Lens(kRadial, {420, 322, 236, -0.25, 0.1})}) {
    const IntrinsicsResult result =
        calibrate_intrinsics(board_views(lens, 12, 0.1, 7), kTestBoard, 640, 480, {.free_board = false});
    EXPECT_EQ(result.fit.model.lens, lens.model()) << result.fit.model.name();
    EXPECT_EQ(result.models.size(), 4u);
    EXPECT_EQ(result.covariance.parameters.size(), static_cast<size_t>(lens.num_params()));
    EXPECT_TRUE(result.warnings.empty());
  }
}

TEST(Intrinsics, BadViewIsNamedAndRemoved) {
  const Lens lens(LensModel::kRadial, {420, 322, 236, -0.2, 0.05});
  std::vector<BoardView> views = board_views(lens, 12, 0.1, 7);
  views[5].corners[17] += Vec2(6, -4);
  const IntrinsicsOptions options{.lens = LensModel::kRadial, .free_board = false};
  const IntrinsicsResult result = calibrate_intrinsics(views, kTestBoard, 640, 480, options);
  for (size_t i = 0; i < views.size(); i++) EXPECT_EQ(result.views[i].used, i != 5) << result.views[i].name;
  EXPECT_GT(result.views[5].rms, 0.5);
  EXPECT_NEAR(result.fit.lens.fx(), 420, 4 * std::sqrt(result.covariance.at(0, 0)));
}

TEST(Intrinsics, UntiltedBoardDoesNotDetermineTheFocalLength) {
  const Lens lens(LensModel::kSimplePinhole, {420, 322, 236});
  const IntrinsicsOptions options{.lens = LensModel::kSimplePinhole, .free_board = false};
  try {
    const IntrinsicsResult result =
        calibrate_intrinsics(board_views(lens, 8, 0.1, 5, 0.01), kTestBoard, 640, 480, options);
    ASSERT_FALSE(result.warnings.empty());
    EXPECT_MENTIONS(result.warnings[0], "focal length", "calibrated");
  } catch (const Error& e) {
    EXPECT_MENTIONS(e.what(), "tilt", "board");
  }
}

TEST(Intrinsics, CalibratesOpenCvsSampleImages) {
  const std::filesystem::path folder = "/usr/share/doc/opencv-doc/examples/data";
  if (!std::filesystem::exists(folder / "left01.jpg")) GTEST_SKIP() << "needs Debian's opencv-doc: " << folder;
  const Checkerboard board{9, 6, 0.025};
  std::vector<BoardView> views;
  for (int i = 1; i <= 14; i++) {
    if (i == 10) continue;
    const std::string name = "left" + std::string(i < 10 ? "0" : "") + std::to_string(i) + ".jpg";
    const auto corners = find_checkerboard(load_image((folder / name).string()), board);
    ASSERT_TRUE(corners) << name;
    views.push_back({name, *corners});
  }
  const IntrinsicsOptions options{.lens = LensModel::kRadial, .free_board = false};
  const IntrinsicsResult result = calibrate_intrinsics(views, board, 640, 480, options);
  EXPECT_TRUE(std::all_of(result.views.begin(), result.views.end(), [](const auto& view) { return view.used; }));
  EXPECT_LE(result.fit.rms, 0.21) << "0.39 with left_intrinsics.yml";
  RecordProperty("rms_px", std::to_string(result.fit.rms));
}

}  // namespace
}  // namespace lf
