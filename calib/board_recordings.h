// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <string>
#include <vector>

#include "calibration/board_detection.h"
#include "calibration/board_motion.h"
#include "command_line.h"
#include "rig/rig.h"

// The options that describe a calibration board.
struct BoardOptions {
  std::string size, charuco;
  double square = lf::CalibrationBoard().square, marker = lf::CalibrationBoard().marker, gap = 0;
  bool legacy = false, inverted = false;
};

// `needs_size` is true if the result depends on the size of the board.
void add_board_options(cli::App& command, BoardOptions& options, bool needs_size = false);

// Throws lf::Error with the option if the description is wrong.
lf::CalibrationBoard parse_board(const BoardOptions& options);

// Returns what to check if no picture shows the board, in sentences.
std::string advice_for(const lf::CalibrationBoard& board);

// The views of a board that were found in the recordings of several cameras: sightings in pictures, or films.
struct BoardRecordings {
  struct Camera {
    size_t pictures = 0, views = 0;  // searched and found
    std::array<size_t, 3> misses{};  // pictures without the board, per BoardMiss
    double coverage = 0;             // share of the image that corners cover
  };
  std::vector<Camera> cameras;
  lf::BoardSightings sightings;
  bool has_films = false;
  lf::BoardFilms films;
  std::vector<double> instants;         // common times of the films, seconds
  std::vector<lf::CameraClock> clocks;  // used to search the films
};

struct BoardSearch {
  int instants = 100;  // searched instants of videos, spread over the first video
  double reach = 0;    // seconds; largest difference of the videos' clocks. 0: about a frame
  int threads = 1;
};

// Searches the board in the recordings in `folder` (see board_images()) of the cameras in `rig`. If the size of a
// camera is 0, the first picture defines it. Shows a progress bar.
//
// Pictures of different cameras show the same instant if their names end with the same number. In videos, the two
// frames before and the two frames after each instant are searched, according to `clocks`. If `clocks` is
// empty, the clocks are estimated if search.reach is positive. Otherwise the timestamps must have one clock.
//
// Throws lf::Error if a picture or video is unusable, or if no picture shows the board.
BoardRecordings detect_boards(const lf::Rig& rig, const std::string& folder, const lf::CalibrationBoard& board,
                              const BoardSearch& search, const lf::SolveOptions& options,
                              std::vector<lf::CameraClock> clocks = {});
