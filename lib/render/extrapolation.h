// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "render/camera_weights.h"
#include "render/ownership.h"
#include "rig/mesh.h"
#include "rig/rig.h"

namespace lf {

// Extrapolation fills the parts of a view that the camera mesh cannot show. Instead of staying empty, these pixels are
// blended from the kExtrapolationCameras cameras with the most similar directions, with the weights of Blending::kAngle
// ("nearest cameras" below).
//
// Lines of sight beside the mesh pass through no face, for example because the viewer has moved out of the array. At
// the border of the mesh, the weights equal the weights of the mesh, which are the linear interpolation between the two
// cameras of the border edge. The share of the nearest cameras grows with the distance d of the line of sight from the
// border, as smoothstep(d / length). The length is a quarter of the median length of the border edges, but at least 32
// pixels of the view at the depth of the border.
//
// In gaps (Blending::fills_gaps), the cameras of the mesh do not see the point in focus, for example in a view from in
// front of the array. Let v be the mean of min(40 b, 1) over these cameras, by weight, where b =
// CameraWeights::visibility(). The cameras of the mesh keep the fraction smoothstep(v / kEnoughVisibility) of their
// weight, at each point of the WeightGrid. The nearest cameras get the rest. Cells with a gap are extrapolated as a
// whole.
inline constexpr int kExtrapolationCameras = 5;
inline constexpr double kEnoughVisibility = 0.25;

// Returns the weights of the cameras in all pixels that must be extrapolated. Returns null if there are none, or if no
// camera sees any of them, for example because the view looks away from the array. `plan` has the faces of the mesh,
// and `runs` their owners in the whole view.
std::shared_ptr<const WeightGrid> extrapolated_weights(const Rig& rig, const Mesh& mesh, const ViewPlan& plan,
                                                       const FaceRuns& runs, const ParallelFor& parallel);

}  // namespace lf
