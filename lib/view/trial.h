// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>

namespace lf {

// A focal surface that a request has the cameras compare beside the one in use, of which every machine makes it by the
// same integers (focus/trial_levels.h).
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

}  // namespace lf
