// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <string>
#include <vector>

#include "calibration/board_solve.h"
#include "rig/rig.h"

// The views of a board that were found in the recordings of several cameras.
struct BoardRecordings {
  struct Camera {
    size_t pictures = 0, views = 0;  // searched and found
    std::array<size_t, 3> misses{};  // pictures without the board, per BoardMiss
    double coverage = 0;             // share of the image that corners cover
  };
  lf::BoardSightings sightings;
  std::vector<Camera> cameras;
};

// Searches the board in the recordings in `folder` (see board_images()) of the cameras in `rig`. If the size of a
// camera is 0, the first picture defines it. Shows a progress bar.
//
// Pictures of different cameras show the same instant if their names end with the same number. Videos show the same
// instant at the same timestamp: `instants` frames of the first camera's video are the instants. A camera without a
// frame at an instant has the corners interpolated between the frames before and after, unless the board moves fast.
//
// Throws lf::Error if a picture or video is unusable, or if no picture shows the board.
BoardRecordings detect_boards(const lf::Rig& rig, const std::string& folder, const lf::CalibrationBoard& board,
                              int instants, int threads);
