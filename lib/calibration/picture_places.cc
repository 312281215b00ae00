// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/picture_places.h"

#include <algorithm>

namespace lf {

void PicturePlaces::come(const Vec2& pixel) {
  const int column = static_cast<int>((pixel.x + 0.5) * kColumns / width_);
  const int row = static_cast<int>((pixel.y + 0.5) * kRows / height_);
  came_[static_cast<size_t>(std::clamp(row, 0, kRows - 1) * kColumns + std::clamp(column, 0, kColumns - 1))] = true;
}

double PicturePlaces::share() const {
  return static_cast<double>(std::ranges::count(came_, true)) / static_cast<double>(came_.size());
}

std::vector<PicturePlaces::Gap> PicturePlaces::gaps() const {
  static constexpr const char* kAcross[] = {"left", "right"};
  static constexpr const char* kDown[] = {"upper", "middle", "lower"};
  std::vector<Gap> gaps;
  for (int row = 0; row < kRows; row++)
    for (int half = 0; half < 2; half++) {
      const int places = !has(2 * half, row) + !has(2 * half + 1, row);
      if (places > 0) gaps.push_back({std::string(kDown[row]) + " " + kAcross[half], places});
    }
  return gaps;
}

std::string listed(const std::vector<PicturePlaces::Gap>& gaps) {
  std::string all;
  for (const PicturePlaces::Gap& gap : gaps) all += (all.empty() ? "" : ", ") + gap.name;
  return all;
}

}  // namespace lf
