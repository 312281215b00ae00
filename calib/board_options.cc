// SPDX-License-Identifier: LGPL-2.1-or-later
#include "board_options.h"

#include <cstdio>

#include "base/text.h"

void add_board_options(cli::App& command, BoardOptions& options, bool needs_size) {
  command
      .add_option("--board", options.size,
                  "Number of inner corners of the board along x and y, for example 9x6. Inner corners are points where "
                  "four squares meet. For an AprilGrid, the number of tags")
      ->required()
      ->type_name("CxR");
  cli::Option* square =
      command
          .add_option("--square", options.square,
                      "Side length of a square of the board, in metres, or of a tag of an AprilGrid. It determines "
                      "distances, but not lenses")
          ->check(cli::PositiveNumber);
  if (needs_size) square->required();
  cli::Option* charuco =
      command
          .add_option("--charuco", options.charuco,
                      "ArUco dictionary of the markers on a ChArUco board, for example 5X5_100. Without this option, "
                      "the board is a plain checkerboard. A ChArUco board need not be completely visible")
          ->type_name("5X5_100");
  command
      .add_option("--marker", options.marker,
                  "Side length of a marker of the ChArUco board, as a fraction of the side of a square. For example, "
                  "0.75 for markers of 30 mm in squares of 40 mm")
      ->check(cli::Range(0.01, 0.99))
      ->needs(charuco);
  command
      .add_flag("--legacy", options.legacy,
                "The ChArUco board has the layout of OpenCV before 4.6: with an even number of rows of squares, the "
                "square at the top left is white")
      ->needs(charuco);
  command.add_flag("--inverted", options.inverted, "Black and white are swapped on the ChArUco board")->needs(charuco);
  command
      .add_option("--april-grid", options.gap,
                  "The board is an AprilGrid of Kalibr. The value is the distance between two tags, as a fraction of "
                  "the side of a tag (Kalibr: tagSpacing), for example 0.3")
      ->type_name("GAP")
      ->check(cli::Range(0.01, 10.0))
      ->excludes(charuco);
}

lf::CalibrationBoard parse_board(const BoardOptions& options) {
  lf::CalibrationBoard board;
  char rest = 0;
  if (std::sscanf(options.size.c_str(), "%dx%d%c", &board.columns, &board.rows, &rest) != 2)
    throw lf::Error("--board " + options.size +
                    ": must be the number of inner corners (or of tags) along x and y, such as 9x6");
  using Kind = lf::CalibrationBoard::Kind;
  board.kind = options.gap > 0 ? Kind::kAprilGrid : !options.charuco.empty() ? Kind::kCharuco : Kind::kCheckerboard;
  board.square = options.square;
  board.dictionary = options.charuco;
  board.marker = options.marker;
  board.legacy = options.legacy;
  board.inverted = options.inverted;
  if (options.gap > 0) board.gap = options.gap;
  try {
    lf::check_board(board);
  } catch (const lf::Error& e) {
    throw lf::Error("--board " + options.size + ": " + e.what());
  }
  return board;
}

std::string advice_for(const lf::CalibrationBoard& board) {
  using Kind = lf::CalibrationBoard::Kind;
  switch (board.kind) {
    case Kind::kCharuco:
      return "Check the dictionary in --charuco, and --inverted. --board counts the corners between squares, not the "
             "squares. The board must be flat and in even light";
    case Kind::kAprilGrid:
      return "--board counts the tags of the family 36h11 along x and y. The board must be flat and in even light";
    case Kind::kCheckerboard: break;
  }
  return "Check that --board counts the corners between squares, not the squares. The board must be flat, in even "
         "light, and completely visible in the image";
}
