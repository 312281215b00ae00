// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calibration/zhang.h"
#include "image/image.h"

namespace lf {

// A checkerboard whose white squares hold ArUco markers, as OpenCV 4.6 draws it: each corner is known by its
// neighbours, so that a part of the board will do, up to the edges of the image, where lenses bend most.
struct CharucoBoard {
  Checkerboard corners;
  std::string dictionary;  // of the markers: "4X4_50", "5X5_100", ... "7X7_1000", "ARUCO_ORIGINAL"
  double marker = 0.5;     // side of a marker, over that of a square
};

// Throws Error where there is no such dictionary, it is too small for the board, or the markers fill their squares.
void check_charuco_board(const CharucoBoard& board);

// The corners that an RGB image shows, to a fraction of a pixel; nothing where these are too few, or in one line.
std::optional<BoardView> find_charuco(const Image& image, const CharucoBoard& board);

}  // namespace lf
