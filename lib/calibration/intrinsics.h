// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "calibration/adjustment.h"
#include "calibration/board_detection.h"
#include "geometry/lens.h"

namespace lf {

class KeyframeSelector {
 public:
  explicit KeyframeSelector(int width) : width_(width) {}  // image width, pixels

  // Call this for each frame with a detected board, in order. Returns true if the calibration should use the frame: the
  // board is stationary and at a new position.
  bool take(const BoardView& view);

 private:
  int width_;
  BoardView last_;
  std::vector<BoardView> kept_;
};

struct ZhangModel {
  LensModel lens = LensModel::kRadial;
  // True if the positions of the corners on the board are estimated as well (Strobl and Hirzinger 2011). Requires views
  // of the whole board.
  bool free_board = false;

  bool operator==(const ZhangModel&) const = default;
  std::string name() const;  // "RADIAL", "RADIAL, board free"
};

// The result of a calibration from views of a board (Zhang 2000).
struct ZhangFit {
  ZhangModel model;
  Lens lens;
  std::vector<double> covariance;  // covariance of lens.params(), row by row, scaled by the residual variance
  std::vector<Vec3> board;         // estimated corners, in board axes
  std::vector<double> view_rms;    // RMS reprojection error of each view, pixels
  double rms = 0;                  // RMS reprojection error of all corners, pixels
  size_t num_params = 0;           // number of parameters of lens, poses and board
  double bic = 0;                  // Bayesian information criterion: lower is better
};

// Fits the lens, the poses and, depending on the model, the board to at least 3 views of the same size. Throws Error if
// the views do not determine the lens.
ZhangFit fit_zhang(const std::vector<BoardView>& views, const CalibrationBoard& board, int width, int height,
                   const ZhangModel& model);

// A fit without bad views: views whose error is several times larger than the median are removed one at a time.
struct GoodViews {
  ZhangFit fit;              // to the good views
  std::vector<size_t> used;  // indices of the good views, increasing
  std::vector<double> rms;   // of all views in pixels; for a bad view, in the last fit that included the view
};
GoodViews fit_good_views(const std::vector<BoardView>& views, const CalibrationBoard& board, int width, int height,
                         const ZhangModel& model);

// The result of fit_good_views() with the model RADIAL, or OPENCV_FISHEYE if it fits clearly better. Both have two
// radial terms for small angles, so that only a wide field of view decides.
GoodViews fit_radial_or_fisheye(const std::vector<BoardView>& views, const CalibrationBoard& board, int width,
                                int height);

// Returns the poses camera_from_board of a view of a flat board, best first: a small or distant board has two similar
// solutions. `board` are the positions of `corners` on the board, and their z is 0. At least four corners are required,
// otherwise there is no pose. Any lens is possible, also corners 90 degrees from the axis and beyond.
std::vector<Pose> board_poses(const Lens& lens, const std::vector<Vec3>& board, const std::vector<Vec2>& corners);

// Validates a lens with a view that was left out of the fit: returns the RMS reprojection error of this view in pixels.
// The fit to this view adjusts only the pose of the board.
double held_out_rms(const ZhangFit& fit, const BoardView& view);

// Options of calibrate_intrinsics(), which removes bad views and selects the smallest model that the views justify.
struct IntrinsicsOptions {
  std::optional<LensModel> lens;                     // nullopt: selected automatically
  std::optional<bool> free_board;                    // nullopt: selected automatically
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
  double held_out_rms = 0;  // RMS reprojection error of views that were left out of the fit (cross-validation), pixels
  CameraCovariance covariance;
  std::vector<View> views;
  std::vector<Model> models;
  std::vector<std::string> warnings;  // parameters that the views do not determine, and the remedy
};

// Calibrates the lens of a camera from views of a board. Throws Error if the views do not determine a lens.
IntrinsicsResult calibrate_intrinsics(const std::vector<BoardView>& views, const CalibrationBoard& board, int width,
                                      int height, const IntrinsicsOptions& options = {});

}  // namespace lf
