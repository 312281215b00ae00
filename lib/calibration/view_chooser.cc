// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/view_chooser.h"

#include <algorithm>
#include <limits>
#include <map>

namespace lf {
namespace {

constexpr double kStill = 0.003;  // of the image's width, from frame to frame: 1 pixel of 320
constexpr double kOther = 0.05;   // that the corners moved by on average

// The mean distance of the corners that both show.
double distance(const BoardView& a, const BoardView& b) {
  std::map<size_t, Vec2> corners;
  for (size_t i = 0; i < a.corners.size(); i++) corners.emplace(a.id(i), a.corners[i]);
  double sum = 0, count = 0;
  for (size_t i = 0; i < b.corners.size(); i++)
    if (const auto found = corners.find(b.id(i)); found != corners.end())
      sum += glm::length(found->second - b.corners[i]), count++;
  return count > 0 ? sum / count : std::numeric_limits<double>::infinity();
}

}  // namespace

bool ViewChooser::take(const BoardView& view) {
  const bool still = distance(last_, view) < kStill * width_;
  last_ = view;
  if (!still) return false;
  if (std::any_of(kept_.begin(), kept_.end(), [&](const auto& k) { return distance(k, view) < kOther * width_; }))
    return false;
  kept_.push_back(view);
  return true;
}

}  // namespace lf
