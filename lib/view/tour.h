// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "rig/rig.h"
#include "view/views_json.h"

namespace lf {

// Depths to focus on, metres from the middle of the array along the mean of its axes; 0 < near <= far.
struct FocusRange {
  double near = 0, far = 0;
};

struct TourOptions {
  int width = 0, height = 0;  // pixels of the views; 0: those of the middle camera
  int frames = 1;             // at least 1
  double rate_hz = 15;        // views per second
  bool still = false;         // all views at time 0, for a scene that stands still
};

// A smooth closed path that shows what an array can do: from its middle to both sides, forward and back, as far as the
// array still covers the whole view, while the focus moves from near to far and back. It begins at the middle with the
// near focus and reaches the far one half-way. Views look along the mean of the cameras' axes and are a little narrower
// than a camera. Requires at least one camera; throws Error if the options are out of range.
std::vector<NamedView> make_tour(const Rig& rig, const FocusRange& focus, const TourOptions& options);

}  // namespace lf
