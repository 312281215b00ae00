// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <string>
#include <vector>

#include "base/vec.h"

namespace lf {

// Which places of a camera's picture, of 4 x 3, a light came to. A plain value.
class PicturePlaces {
 public:
  static constexpr int kColumns = 4, kRows = 3;

  // The size of the picture, pixels.
  PicturePlaces(int width, int height) : width_(width), height_(height) {}

  // The light came to this pixel; what is outside of the picture counts as its border.
  void come(const Vec2& pixel);
  bool has(int column, int row) const { return came_[static_cast<size_t>(row * kColumns + column)]; }
  double share() const;  // of the places, 0 to 1
  // Where it did not come, in the words of who looks at the picture, in the order of reading.
  struct Gap {
    std::string name;  // "upper left", "middle right"
    int places = 0;    // how many places, of two, it did not come to
  };
  std::vector<Gap> gaps() const;

 private:
  int width_, height_;
  std::array<bool, static_cast<size_t>(kColumns) * kRows> came_{};
};

// The names of gaps: "upper left, lower right".
std::string listed(const std::vector<PicturePlaces::Gap>& gaps);

}  // namespace lf
