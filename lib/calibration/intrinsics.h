// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "calibration/camera_covariance.h"
#include "calibration/zhang.h"

namespace lf {

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
