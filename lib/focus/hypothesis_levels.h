// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "geometry/pose.h"
#include "view/view.h"
#include "view/view_request.h"

namespace lf {

// Returns the inverse distance from `from`, along its normal, at which a line of sight (view coordinates) meets the
// viewer's focal plane; 0 if they do not meet.
double plane_inverse(const View& view, const Plane& from, const Vec3& ray);

// Returns the viewer's focal plane as a map between two inverse distances (1/m, farthest < nearest), clamped to this
// range. The map has the nodes of the view's map, or nodes `step` pixels apart if the view has none.
FocalMap plane_map(const View& view, const Plane& from, double nearest, double farthest, int step = FocalMap::kMinStep);

// Returns the hypothesis's levels, one for each node of the view's map.
std::vector<uint8_t> hypothesis_levels(const View& view, const DepthHypothesis& hypothesis);
// Returns the hypothesis's levels from the map alone; kFocused counts as kBlurred.
std::vector<uint8_t> hypothesis_levels(const FocalMap& surface, const DepthHypothesis& hypothesis);

struct LevelRange {
  int first = 0, last = 255;
  bool operator==(const LevelRange&) const = default;
};

// Returns the hypotheses for refinement round `round` of a view: the smoothed surface, two that move depth edges and
// correct small errors, and one of kSweepPlanes planes over `scene`, the known levels of the scene. Every
// kOutsideEvery-th time the plane is outside of `scene`, to find new objects.
inline constexpr int kSweepPlanes = 12, kOutsideEvery = 4;
std::vector<DepthHypothesis> hypotheses_of_round(unsigned round, const LevelRange& scene = {});

// Returns the view in which hypotheses are rendered: one pixel for each node of the map, with the node at its centre.
// It is blended by the mesh, or by the kHypothesisCameras nearest cameras if the picture is blended by angle.
inline constexpr int kHypothesisCameras = 4;
View hypothesis_view(const View& view);

}  // namespace lf
