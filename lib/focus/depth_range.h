// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "focus/trial.h"
#include "geometry/focal_surface.h"

namespace lf {

// Inverse distances, 1/m, farthest < nearest.
struct DepthRange {
  double farthest = 0, nearest = 0;
  bool operator==(const DepthRange&) const = default;
};

// The levels that a scene is at: of all but 1 % of the nodes to each side, and a tenth more. `map` has nodes.
LevelRange levels_in_use(const FocalMap& map);

// The range that a map of this scene should have: half as far again and half as near as it is, to notice what comes from
// there. The map's own while that is not much off: while nothing lies at its ends, and half of it is of use.
DepthRange range_for(const FocalMap& map);

// The same surface in another range: each node at the level nearest to where it was.
void set_range(const DepthRange& range, FocalMap& map);

}  // namespace lf
