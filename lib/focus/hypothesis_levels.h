// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/pose.h"
#include "view/view.h"
#include "view/view_request.h"

namespace lf {

// Returns the inverse distance, in 1/m, of the point where a line of sight meets the viewer's focal plane. `ray` is in
// view coordinates. The distance is measured from the plane `from`, along its normal. Returns 0 if the line of sight
// does not meet the focal plane.
double plane_inverse(const View& view, const Plane& from, const Vec3& ray);

// Converts the viewer's focal plane to a focal map with a range of inverse distances (in 1/m, farthest < nearest).
// Depths outside this range are clamped. The map has the nodes of the view's map. If the view has no map, its nodes are
// `step` pixels apart.
FocalMap plane_map(const View& view, const Plane& from, double nearest, double farthest, int step = FocalMap::kMinStep);

// Computes the depth map of a hypothesis: the level of each node of the view's map. The view must have a map.
std::vector<uint8_t> hypothesis_levels(const View& view, const DepthHypothesis& hypothesis);
// Does the same without the view. kFocused, which needs the viewer's focal plane, counts as kBlurred.
std::vector<uint8_t> hypothesis_levels(const FocalMap& surface, const DepthHypothesis& hypothesis);

// Computes the depth maps of several hypotheses of a request, in their order. Omits kMeasured, which must be the last:
// only nodes with depth maps know its levels.
std::vector<std::vector<uint8_t>> hypothesis_levels(const View& view, std::span<const DepthHypothesis> hypotheses);

// A range of levels of a focal map, from `first` to `last` inclusive.
struct LevelRange {
  int first = 0, last = 255;
  bool operator==(const LevelRange&) const = default;
};

// Returns the hypotheses that the cameras test in refinement round `round` of a view. These are the smoothed surface,
// two hypotheses that move depth edges and correct small errors, and one plane. The planes of successive rounds cover
// `scene`, the known levels of the scene, in kSweepPlanes steps. In every kOutsideEvery-th round, the plane is outside
// `scene`, to find new objects.
inline constexpr int kSweepPlanes = 12, kOutsideEvery = 4;
std::vector<DepthHypothesis> hypotheses_of_round(unsigned round, const LevelRange& scene = {});

// Returns the view for rendering hypotheses. It has one pixel for each node of the map, centred on the node, because
// hypotheses need a low resolution only. The view is blended by the mesh. If the picture is blended by angle, it is
// blended by the kHypothesisCameras nearest cameras.
inline constexpr int kHypothesisCameras = 4;
View hypothesis_view(const View& view);

}  // namespace lf
