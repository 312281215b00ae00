// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "calibration/boards.h"
#include "geometry/lens.h"

namespace lf {

// The terms of a lens that are estimated, and whether the board is taken for flat and even.
struct ZhangModel {
  LensModel lens = LensModel::kRadial;
  // The corners' true places are estimated, too (Strobl and Hirzinger 2011): boards are printed and mounted by hand.
  // Needs views of the whole board.
  bool free_board = false;

  bool operator==(const ZhangModel&) const = default;
  std::string name() const;  // "RADIAL", "RADIAL, board free"
};

// What a calibration from views of a board comes to (Zhang 2000).
struct ZhangFit {
  ZhangModel model;
  Lens lens;
  std::vector<double> covariance;  // covariance of lens.params(), row by row, scaled by what the residuals show
  std::vector<Vec3> board;         // the corners as estimated, in the board's axes
  std::vector<double> view_rms;    // rms distance of each view's corners, pixels
  double rms = 0;                  // pixels (of the distances, over all corners)
  size_t num_params = 0;           // lens, poses and board
  double bic = 0;                  // Bayesian information criterion: lower is better
};

// Fits lens, poses and, if it is free, the board to at least 3 views of one size. Throws Error where they do not
// determine a lens.
ZhangFit fit_zhang(const std::vector<BoardView>& views, const Checkerboard& board, int width, int height,
                   const ZhangModel& model);

// How far corners of another view lie from where `fit` sees them, once the board's pose is fitted: RMS distance,
// pixels.
double held_out_rms(const ZhangFit& fit, const BoardView& view);

}  // namespace lf
