// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>

#include "rig/rig.h"
#include "view/view_request.h"

namespace lf {

// Returns the focus distance that makes `pixel` sharp: the distance from the viewpoint, along the view's axis, of the
// focal surface at this pixel. It is the median of 3 x 3 nodes of the focal map, so that single wrong nodes do not
// matter. Returns nothing if the surface is behind the viewpoint there, or at infinity. The view must have a map.
std::optional<double> focus_distance_at(const View& view, const Vec2& pixel);

// Returns the part of the view around `pixel`, kSweptPixels wide and high, without a focal map. An autofocus search
// only needs this part.
inline constexpr int kSweptPixels = 64;  // pixels
View view_around(const View& view, const Vec2& pixel);

// Turns a request for a view without a focal map into an autofocus request. The cameras then compare their images at
// many depths, and the depth with the best agreement is the focus distance. The request gets a map of the viewer's
// focal plane, and depth hypotheses that are planes at constant distance.
//
// An autofocus search has two stages. The first stage (without `found`) covers all depths from infinity to 0.3 of the
// focus distance. If the focus is more than three times as far as `reach` (an inverse distance in 1/m; see
// sweep_reach()), the first stage covers infinity to `reach` instead. The second stage covers the depths around
// `found`, the result of the first stage (see focus_distance_at()), by a factor of 1.5 in both directions. `from` is
// the reference plane of distances; see FocalMap.
void add_focus_sweep(ViewRequest& request, const Plane& from, std::optional<double> found, double reach = 0);

// Returns the largest inverse distance, in 1/m, that the first stage can cover without gaps between its planes.
// Neighbouring planes may differ in the disparity between neighbouring cameras by at most half the side of the low-pass
// box of the hypotheses. Returns 0 for a single camera.
double sweep_reach(const Rig& rig, const View& view);

// Returns true if `distance`, the result of a second stage around `found`, is clearly inside the range of that stage. A
// result at the end of the range may mean that the object is outside the range, so the search must start again.
bool is_inside_sweep(double distance, double found);

}  // namespace lf
