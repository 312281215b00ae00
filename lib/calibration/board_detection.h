// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/maths.h"
#include "image/image.h"

namespace lf {

// A flat calibration board. Its corners form a grid and are counted row by row, from the top left as printed.
struct CalibrationBoard {
  enum class Kind {
    kCheckerboard,  // corners are the inner corners, where four squares meet
    kCharuco,       // a checkerboard with ArUco markers in its white squares
    kAprilGrid,     // a grid of tags of the family 36h11, as printed by Kalibr; corners are the corners of the tags
  };

  int columns = 0, rows = 0;  // number of inner corners, or of tags; a chess board has 7x7 inner corners
  double square = 1;          // side of a square, or of a tag, in metres; 1 if only the lens matters
  Kind kind = Kind::kCheckerboard;
  // ChArUco: ArUco dictionary of the markers: "4X4_50", "5X5_100", ... "7X7_1000", "ARUCO_ORIGINAL"
  std::string dictionary;
  double marker = 0.5;  // ChArUco: side of a marker, relative to a square
  // ChArUco: layout of OpenCV before 4.6. It starts with a white square if the number of rows of squares is even;
  // otherwise, both layouts are the same.
  bool legacy = false;
  bool inverted = false;  // ChArUco: black and white are swapped
  double gap = 0.3;       // AprilGrid: distance between two tags, relative to the side of a tag

  int grid_columns() const { return kind == Kind::kAprilGrid ? 2 * columns : columns; }
  int grid_rows() const { return kind == Kind::kAprilGrid ? 2 * rows : rows; }
  size_t num_corners() const { return static_cast<size_t>(grid_columns()) * static_cast<size_t>(grid_rows()); }
  Vec2 corner(size_t i) const;  // position in metres; x points right and y down, as printed
  std::string name() const;     // "ChArUco board of 9x6 inner corners (5X5_100)"
  // True if the board looks the same after half a turn, so that two cameras may count its corners from opposite ends.
  bool is_symmetric() const { return kind == Kind::kCheckerboard && (columns + rows) % 2 == 0; }
};

// Checks a description of a board. Throws Error if a size is out of range, the dictionary is unknown or too small for
// the board, or markers fill their squares.
void check_board(const CalibrationBoard& board);

struct BoardView {
  std::string name;           // image name for messages
  std::vector<Vec2> corners;  // pixels
  std::vector<int> ids;       // indices of the corners on the board; empty: all corners, in order

  size_t id(size_t i) const { return ids.empty() ? i : static_cast<size_t>(ids[i]); }
};

// Why a board was not found.
enum class BoardMiss {
  kNothing,    // no checkerboard or marker of this kind in the image
  kPartial,    // too few corners are visible, or all on one line
  kOtherBoard  // markers are visible, but not at the places that the description states
};

// Finds the board in an RGB image, with subpixel accuracy. A checkerboard must be completely visible. Markers identify
// the corners of the other boards, so partial views count, up to the image border where lens distortion is largest.
// Sets `miss` if the board is not found.
std::optional<BoardView> find_board(const Image& image, const CalibrationBoard& board, BoardMiss* miss = nullptr);

}  // namespace lf
