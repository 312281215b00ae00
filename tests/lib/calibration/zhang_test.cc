// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/zhang.h"

#include <cmath>

#include <gtest/gtest.h>

#include "support/board_views.h"
#include "support/expect_error.h"

namespace lf {
namespace {

const Lens kLens(LensModel::kRadial, {420, 322, 236, -0.2, 0.05});

TEST(Zhang, FindsTheLensThatMadeTheViews) {
  for (const bool free_board : {false, true}) {
    const ZhangFit fit =
        fit_zhang(board_views(kLens, 10, 0, 1), kTestBoard, 640, 480, {LensModel::kRadial, free_board});
    EXPECT_LT(fit.rms, 1e-4) << "OpenCV keeps pixels as floats";
    for (int i = 0; i < 5; i++) EXPECT_NEAR(fit.lens.params()[i], kLens.params()[i], i < 3 ? 1e-2 : 1e-4) << i;
  }
  const Lens pinhole(LensModel::kPinhole, {420, 430, 322, 236});
  const ZhangFit fit = fit_zhang(board_views(pinhole, 10, 0, 1), kTestBoard, 640, 480, {LensModel::kPinhole});
  for (int i = 0; i < 4; i++) EXPECT_NEAR(fit.lens.params()[i], pinhole.params()[i], 1e-2) << i;
}

// Errors over many seeds, in units of the reported covariance: 5 degrees of freedom each.
TEST(Zhang, TheCovarianceIsThatOfTheErrors) {
  for (const bool free_board : {false, true}) {
    const int seeds = free_board ? 6 : 30;
    double sum = 0;
    for (int seed = 1; seed <= seeds; seed++) {
      const ZhangFit fit =
          fit_zhang(board_views(kLens, 8, 0.1, seed), kTestBoard, 640, 480, {LensModel::kRadial, free_board});
      const double residuals = 2.0 * 8 * static_cast<double>(kTestBoard.num_corners());
      EXPECT_NEAR(fit.rms, 0.1 * std::sqrt(2 * (1 - static_cast<double>(fit.num_params) / residuals)), 0.015);
      for (int i = 0; i < 5; i++)
        sum += std::pow(fit.lens.params()[i] - kLens.params()[i], 2) / fit.covariance[i * 5 + i];
    }
    EXPECT_GT(sum / (5 * seeds), 0.5) << free_board;
    EXPECT_LT(sum / (5 * seeds), 1.8) << free_board;
  }
}

TEST(Zhang, ABoardThatIsNotFlatIsFoundAsItIs) {
  std::vector<BoardView> views = board_views(kLens, 12, 0.05, 4);
  const ZhangModel flat{LensModel::kRadial, false}, free{LensModel::kRadial, true};
  const double flat_rms = fit_zhang(views, kTestBoard, 640, 480, flat).rms;
  // A corner printed 0.3 mm off: the same shift across the board in every view, here in its image.
  for (BoardView& view : views) {
    const Vec2 along = (view.corners[21] - view.corners[20]) / kTestBoard.square;
    view.corners[20] += along * 3e-4;
  }
  EXPECT_GT(fit_zhang(views, kTestBoard, 640, 480, flat).rms, flat_rms * 1.05);
  const ZhangFit fit = fit_zhang(views, kTestBoard, 640, 480, free);
  EXPECT_NEAR(fit.board[20].x - kTestBoard.corner(20).x, 3e-4, 1e-4);
}

TEST(Zhang, HeldOutViewsAreSeenAsTheyAre) {
  const ZhangFit fit = fit_zhang(board_views(kLens, 10, 0.05, 1), kTestBoard, 640, 480, {});
  EXPECT_NEAR(held_out_rms(fit, board_views(kLens, 1, 0.05, 99)[0]), 0.05 * std::sqrt(2), 0.02);
}

TEST(Zhang, ViewsThatDetermineNothingAreRefused) {
  EXPECT_ERROR(fit_zhang(board_views(kLens, 2, 0.1, 1), kTestBoard, 640, 480, {}), "at least 3 views");
}

}  // namespace
}  // namespace lf
