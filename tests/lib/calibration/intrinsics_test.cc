// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/intrinsics.h"
#include "image/image.h"
#include "support/board_views.h"
#include "support/expect_error.h"
#include "support/test.h"

namespace lf {
namespace {

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

// The board covers the middle of the picture only, so the terms of the wide field are checked by positions.
TEST(Zhang, FindsGeneralLenses) {
  using enum LensModel;
  for (const Lens& lens : {Lens(kOpenCvFisheye, {230, 230, 322, 236, 0.03, -0.01, 0.002, -3e-4}),
                           Lens(kFullOpenCv, {420, 425, 322, 236, -0.2, 0.05, 1e-3, -2e-3, 0.01, 0.1, 0.02, -0.01})}) {
    SCOPED_TRACE(lens_model_name(lens.model()));
    const ZhangFit fit = fit_zhang(board_views(lens, 12, 0.02, 1), kTestBoard, 640, 480, {lens.model()});
    EXPECT_NEAR(fit.rms, 0.02 * std::sqrt(2), 0.003);
    EXPECT_NEAR(fit.lens.fx(), lens.fx(), 1);
    EXPECT_NEAR(fit.lens.fx(), lens.fx(), 5 * std::sqrt(fit.covariance[0]));
    for (const Vec3& point : {Vec3(0, 0, 1), Vec3(0.3, 0.2, 1), Vec3(-0.25, 0.3, 1)})
      EXPECT_LT(glm::length(*fit.lens.project(point) - *lens.project(point)), 0.5);
    EXPECT_NEAR(held_out_rms(fit, board_views(lens, 1, 0.02, 99)[0]), 0.02 * std::sqrt(2), 0.01);
  }
  EXPECT_ERROR(fit_zhang(board_views(kZhangLens, 8, 0.1, 1), kTestBoard, 640, 480, {kOpenCvFisheye, true}),
               "OPENCV_FISHEYE", "board");
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

// Corners up to 95 degrees from the axis, and a board that is often far from the axis.
TEST(Intrinsics, RecognisesAFisheyeLens) {
  const Lens lens(LensModel::kOpenCvFisheye, {150, 150, 322, 236, 0.02, -0.004, 0, 0});
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::normal_distribution<double> normal(0, 0.1);
  std::vector<BoardView> views;
  int beyond = 0;
  while (views.size() < 16) {
    const Quat aside =
        glm::angleAxis(1.5 * uniform(random), Vec3(0, 1, 0)) * glm::angleAxis(1.1 * uniform(random), Vec3(1, 0, 0));
    const Pose pose = board_pose(random, 0.6);
    BoardView view{"view", {}, {}};
    for (size_t i = 0; i < kTestBoard.num_corners(); i++) {
      const Vec3 at = aside * pose.world_from_camera(Vec3(kTestBoard.corner(i), 0));
      const auto pixel = lens.project(at);
      if (!pixel || pixel->x < 0 || pixel->y < 0 || pixel->x > 639 || pixel->y > 479) continue;
      beyond += at.z < 0;
      view.ids.push_back(static_cast<int>(i));
      view.corners.push_back(*pixel + Vec2(normal(random), normal(random)));
    }
    if (view.corners.size() >= 12) views.push_back(view);
  }
  EXPECT_GT(beyond, 0);
  const IntrinsicsResult result = calibrate_intrinsics(views, kTestBoard, 640, 480, {.free_board = false});
  ASSERT_EQ(result.fit.model.lens, LensModel::kOpenCvFisheye);
  EXPECT_NEAR(result.fit.rms, 0.1 * std::sqrt(2), 0.02);
  EXPECT_NEAR(result.fit.lens.fx(), 150, 1);
  EXPECT_EQ(result.covariance.parameters.back(), "k4");
  for (const double angle : {0.3, 0.8, 1.2, 1.5})
    EXPECT_LT(glm::length(*result.fit.lens.project({std::sin(angle), 0, std::cos(angle)}) -
                          *lens.project({std::sin(angle), 0, std::cos(angle)})),
              0.5)
        << angle;
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
  const CalibrationBoard board{9, 6, 0.025};
  std::vector<BoardView> views;
  for (int i = 1; i <= 14; i++) {
    if (i == 10) continue;
    const std::string name = "left" + std::string(i < 10 ? "0" : "") + std::to_string(i) + ".jpg";
    const auto view = find_board(load_image((folder / name).string()), board);
    ASSERT_TRUE(view) << name;
    views.push_back({name, view->corners});
  }
  const IntrinsicsOptions options{.lens = LensModel::kRadial, .free_board = false};
  const IntrinsicsResult result = calibrate_intrinsics(views, board, 640, 480, options);
  EXPECT_TRUE(std::all_of(result.views.begin(), result.views.end(), [](const auto& view) { return view.used; }));
  EXPECT_LE(result.fit.rms, 0.21) << "0.39 with left_intrinsics.yml";
  RecordProperty("rms_px", std::to_string(result.fit.rms));
}

}  // namespace
}  // namespace lf
