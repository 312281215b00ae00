// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/vec.h"
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

}  // namespace lf
