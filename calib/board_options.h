// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "calibration/board_detection.h"
#include "command_line.h"

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
