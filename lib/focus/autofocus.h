// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>

#include "rig/rig.h"
#include "view/view_request.h"

namespace lf {

// Returns the distance along the view's axis at which a focal plane makes `pixel` sharp, from the median of 3 x 3 map
// nodes. Returns nothing if the surface is behind the viewpoint there, or at infinity. The view must have a map.
std::optional<double> focus_distance_at(const View& view, const Vec2& pixel);

// Returns a small view centred on `pixel`, without a focal map.
inline constexpr int kSweptPixels = 64;  // side of view_around(), pixels
View view_around(const View& view, const Vec2& pixel);

// Turns a request for a view without a map into an autofocus request: the map becomes the viewer's plane, and the
// hypotheses are planes. The first stage (no `found`) covers all depths from infinity to 0.3 of the focus distance. For
// a focus much farther than `reach` (inverse distance, 1/m; see sweep_reach()), it covers the depths up to `reach`. The
// second stage covers the depths around `found` (see focus_distance_at()). `from`: see FocalMap.
void add_focus_sweep(ViewRequest& request, const Plane& from, std::optional<double> found, double reach = 0);

// Returns the largest inverse distance, 1/m, that the first stage covers without gaps: from plane to plane, the
// disparity between neighbouring cameras changes by half the box that blurs the hypotheses. 0 for a single camera.
double sweep_reach(const Rig& rig, const View& view);

// True if `distance`, the result of a second stage around `found`, is clear of the limits of that stage's range.
bool is_inside_sweep(double distance, double found);

}  // namespace lf
