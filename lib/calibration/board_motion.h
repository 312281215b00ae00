// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "calibration/board_solve.h"
#include "calibration/camera_clock.h"
#include "calibration/report.h"

namespace lf {

// The views of a moving board in the films of several cameras that are not synchronised.
struct BoardFilms {
  struct Frame {
    double stamp = 0;  // seconds, on the camera's clock
    BoardView view;
  };
  CalibrationBoard board;
  std::vector<Tracks::Camera> cameras;
  std::vector<std::vector<Frame>> frames;  // per camera, in the order of time; only frames that show the board
  std::vector<double> frame_times;         // seconds between two searched frames of each camera
};

// A rolling shutter reads the rows of an image one by one. The capture time of a frame is the time of its middle row.
struct RollingShutter {
  double readout =
      0;             // seconds from the first row to the last row; negative: the last row is first; 0: not significant
  double sigma = 0;  // standard deviation of `readout`, seconds
  double shift = 0;  // RMS displacement of the corners by the readout during the recording, pixels
  // The displacement by a readout time of two sigmas, which is not corrected if `readout` is 0, pixels.
  double uncertain = 0;
};

struct MovingBoardSolution : BoardSolution {
  std::vector<CameraClock> clocks;  // relative to the median of the known offsets. Unknown clocks keep their start
  std::vector<double> expected;     // clock offsets at the start, seconds
  std::vector<RollingShutter> shutters;
  double seconds = 0;          // length of the recording
  ClockAdjustment adjustment;  // times and velocities of the corners, for estimate_uncertainty()
};

// Estimates clock offsets of up to `reach` seconds to a few hundredths of a second, without knowing the cameras'
// positions. The turns and shifts of the board in its own axes are the same for all cameras, so their correlation is
// largest at the right offset. The offsets are relative to the camera with most views. `frames` should have about ten
// views per second, over the whole recording.
std::vector<CameraClock> coarse_board_clocks(const BoardFilms& films, double reach, const SolveOptions& options);

// Estimates cameras, clocks and rolling shutters. The corners are interpolated at `instants`, seconds on the common
// time, by cubics through the two frames before and the two frames after the instant. `clocks` are the clocks to start
// from; errors should be smaller than a frame. A clock remains unknown if the board hardly moves.
//
// A readout time displaces a corner by its image velocity times the time from the middle row to its own row. A readout
// time or a drift that is not significant becomes 0.
MovingBoardSolution solve_moving_board(const BoardFilms& films, const std::vector<double>& instants,
                                       std::vector<CameraClock> clocks, const SolveOptions& options);

std::vector<Finding> diagnose_times(const MovingBoardSolution& solution);

// Adds members to the cameras of a calibration_report(): the members of add_clocks() for known clocks, "readout_ms",
// "readout_sigma_ms", and "rolling_shutter_px", the RMS displacement of the corners.
void add_times(const MovingBoardSolution& solution, nlohmann::ordered_json& report);

}  // namespace lf
