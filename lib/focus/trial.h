// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "geometry/focal_surface.h"
#include "view/view.h"

namespace lf {

// A surface that is tried beside the one in use: made of that by the same integers on every machine.
struct Trial {
  enum class Kind : uint8_t {
    kBlurred = 0,  // the surface, smoothed: [1 6 1] / 8 along rows and columns
    kFarther = 1,  // the least level of a node and its eight neighbours, smoothed
    kNearer = 2,   // the largest
    kShifted = 3,  // smoothed, `value` levels nearer
    kPlane = 4,    // level `value` everywhere
    kFocused = 6,  // the viewer's plane
  };
  Kind kind = Kind::kBlurred;
  int16_t value = 0;  // levels
  bool operator==(const Trial&) const = default;
};

inline constexpr size_t kMaxTrials = 16;  // of one request

// The trial's levels, one for each node of the view's map.
std::vector<uint8_t> trial_levels(const View& view, const Trial& trial);
// The same of a map alone; kFocused counts as kBlurred.
std::vector<uint8_t> trial_levels(const FocalMap& surface, const Trial& trial);

// Levels from `first` to `last`.
struct LevelRange {
  int first = 0, last = 255;
  bool operator==(const LevelRange&) const = default;
};

// What is tried in round `round` of a view to better the surface that it has: the smoothed surface, two that let depth
// edges move and small errors heal, and one of kSweepPlanes planes over `scene`, the levels that the scene is known to
// be at, or every kOutsideEvery-th time one of those outside, so that nothing near or far is missed for long.
inline constexpr int kSweepPlanes = 12, kOutsideEvery = 4;
std::vector<Trial> trials_of_round(unsigned round, const LevelRange& scene = {});

// The view that trials are rendered in: a pixel for each node of the map, which lies in its middle.
View trial_view(const View& view);

}  // namespace lf
