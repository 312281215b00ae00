// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "geometry/pose.h"
#include "view/view.h"
#include "view/view_request.h"

namespace lf {

// The inverse distance from `from`, along its normal, at which a line of sight (view coordinates) meets the viewer's
// focal plane; 0 if it does not.
double plane_inverse(const View& view, const Plane& from, const Vec3& ray);

// The viewer's focal plane as a map between two inverse distances (1/m, farthest < nearest), clamped to them. Nodes are
// as those of the view's map, or without one `step` pixels apart.
FocalMap plane_map(const View& view, const Plane& from, double nearest, double farthest,
                   int step = FocalMap::kFinestStep);

// The trial's levels, one for each node of the view's map.
std::vector<uint8_t> trial_levels(const View& view, const Trial& trial);
// The trial's levels where the map alone is known; kFocused counts as kBlurred.
std::vector<uint8_t> trial_levels(const FocalMap& surface, const Trial& trial);

// A range of levels from `first` to `last`.
struct LevelRange {
  int first = 0, last = 255;
  bool operator==(const LevelRange&) const = default;
};

// What is tried in round `round` of a view to better the surface that it has: the smoothed surface, two that let depth
// edges move and small errors heal, and one of kSweepPlanes planes over `scene`, the levels that the scene is known to
// be at, or every kOutsideEvery-th time one of those outside, so that nothing near or far is missed for long.
inline constexpr int kSweepPlanes = 12, kOutsideEvery = 4;
std::vector<Trial> trials_of_round(unsigned round, const LevelRange& scene = {});

// The view that trials are rendered in: one pixel for each node of the map, which lies in the middle of the pixel. The
// view is blended by the mesh, or by the kTrialCameras nearest cameras where the picture is blended by angle.
inline constexpr int kTrialCameras = 4;
View trial_view(const View& view);

}  // namespace lf
