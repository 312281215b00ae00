// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/maths.h"
#include "calibration/adjustment.h"
#include "geometry/lens.h"
#include "image/image.h"

namespace lf {

// A flat board of black and white squares. Corners are those between four squares, counted row by row.
struct Checkerboard {
  int columns = 0, rows = 0;  // inner corners: a chess board has 7x7
  double square = 1;          // side of a square; metres, or 1 where only lenses are wanted

  size_t num_corners() const { return static_cast<size_t>(columns) * rows; }
  Vec2 corner(size_t i) const {
    return Vec2(static_cast<double>(i % columns), static_cast<double>(i / columns)) * square;
  }
};

// What one image shows of the board.
struct BoardView {
  std::string name;           // tells a person which image this is
  std::vector<Vec2> corners;  // pixels
  std::vector<int> ids;       // which of the board's corners these are; empty: all of them, in order

  size_t id(size_t i) const { return ids.empty() ? i : static_cast<size_t>(ids[i]); }
};

// The corners of the whole board in an RGB image, in pixels, to a fraction of one; nothing where it is not there or
// a part of it is hidden.
std::optional<std::vector<Vec2>> find_checkerboard(const Image& image, const Checkerboard& board);

// A checkerboard whose white squares hold ArUco markers, as OpenCV 4.6 draws it: each corner is known by its
// neighbours, so that a part of the board will do, up to the edges of the image, where lenses bend most.
struct CharucoBoard {
  Checkerboard corners;
  std::string dictionary;  // the dictionary of the markers: "4X4_50", "5X5_100", ... "7X7_1000", "ARUCO_ORIGINAL"
  double marker = 0.5;     // side of a marker, over that of a square
};

// Throws Error where there is no such dictionary, it is too small for the board, or the markers fill their squares.
void check_charuco_board(const CharucoBoard& board);

// The corners that an RGB image shows, to a fraction of a pixel; nothing where these are too few, or in one line.
std::optional<BoardView> find_charuco(const Image& image, const CharucoBoard& board);

// Chooses the frames of a board moved before a camera that are worth keeping: where it stands still, so that nothing is
// blurred or sheared by a rolling shutter, and not as in any frame kept before.
class ViewChooser {
 public:
  explicit ViewChooser(int width) : width_(width) {}  // the images' width, pixels

  // Takes frames in order, those without the board left out. True: the frame is worth keeping.
  bool take(const BoardView& view);

 private:
  int width_;
  BoardView last_;
  std::vector<BoardView> kept_;
};

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

// How one camera's lens is found from views of a board: bad views are left out, and the model is the smallest that the
// views speak for.
struct IntrinsicsOptions {
  std::optional<LensModel> lens;                     // nothing: chosen by evidence
  std::optional<bool> free_board;                    // nothing: chosen by evidence
  std::function<void(const std::string&)> progress;  // called before each step; may throw to cancel
};

struct IntrinsicsResult {
  struct View {
    std::string name;
    double rms = 0;  // pixels
    bool used = true;
  };
  struct Model {
    ZhangModel model;
    double rms = 0, held_out_rms = 0;  // pixels
    size_t num_params = 0;
    double bic = 0;
  };
  ZhangFit fit;
  double held_out_rms = 0;  // pixels: views that a fit to the others did not see
  CameraCovariance covariance;
  std::vector<View> views;
  std::vector<Model> models;          // all models that were looked at
  std::vector<std::string> warnings;  // what the views do not determine, and what to do about it
};

// Throws Error where a lens can't be had from the views.
IntrinsicsResult calibrate_intrinsics(const std::vector<BoardView>& views, const Checkerboard& board, int width,
                                      int height, const IntrinsicsOptions& options = {});

}  // namespace lf
