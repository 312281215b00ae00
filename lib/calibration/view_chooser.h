// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "calibration/zhang.h"

namespace lf {

// Which frames of a board that is moved before a camera are worth keeping: where it stands still, so that nothing is
// blurred or sheared by a rolling shutter, and not as in any frame kept before.
class ViewChooser {
 public:
  explicit ViewChooser(int width) : width_(width) {}  // of the images

  // Frames in order, those without the board left out. True: keep it.
  bool take(const BoardView& view);

 private:
  int width_;
  BoardView last_;
  std::vector<BoardView> kept_;
};

}  // namespace lf
