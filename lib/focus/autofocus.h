// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>

#include "rig/rig.h"
#include "view/view_request.h"

namespace lf {

// The distance along the view's axis at which its focal map has a pixel: what a viewer's plane has to be at to be sharp
// there. The median of 3 x 3 nodes. Nothing if the surface is behind the eye there, or at infinity. The view has a map.
std::optional<double> focus_distance_at(const View& view, const Vec2& pixel);

// A small view of what is around a pixel of a view, which is then its middle.
inline constexpr int kSweptPixels = 64;  // pixels along a side of view_around()
View view_around(const View& view, const Vec2& pixel);

// Asks the cameras where a view is in focus that has no map: gives the request the viewer's plane as a map, and planes
// to try. Two stages: all depths that a viewer could mean, from infinity to three tenths of the focus distance, or if
// that is far, to `reach` (inverse distance, 1/m; see sweep_reach()); and then those around `found` (see
// focus_distance_at()). `from`: see FocalMap.
void add_focus_sweep(ViewRequest& request, const Plane& from, std::optional<double> found, double reach = 0);

// How near the first stage of a sweep can reach without leaving anything out, 1/m: from plane to plane what
// neighbouring cameras see moves by half of what the trials blur it.
double sweep_reach(const Rig& rig, const View& view);

// Whether a distance that a second stage around `found` came to is inside what that stage tried, and not at its limit,
// beyond which nothing was tried.
bool is_inside_sweep(double distance, double found);

}  // namespace lf
