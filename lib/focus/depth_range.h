// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "focus/trial_levels.h"
#include "geometry/focal_surface.h"

namespace lf {

// Inverse distances, 1/m, farthest < nearest.
struct DepthRange {
  double farthest = 0, nearest = 0;
  bool operator==(const DepthRange&) const = default;
};

// The same surface in another range: each node at the level nearest to where it was.
void set_range(const DepthRange& range, FocalMap& map);

}  // namespace lf
