// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "render/camera_weights.h"
#include "render/ownership.h"
#include "rig/mesh.h"
#include "rig/rig.h"

namespace lf {

// Weights for lines of sight that pass beside the camera mesh, for example because the viewer has moved out of the
// array. Such pixels are extrapolated from the nearest cameras instead of staying empty.
//
// At the border of the mesh the weights equal the weights of the mesh, which are the linear interpolation between the
// two cameras of the border edge. With growing distance d of the line of sight from the border, they change to
// Blending::kAngle with kExtrapolationCameras cameras. The share of the latter is smoothstep(d / length). The length is
// a quarter of the median length of the border edges, but at least 32 pixels of the view at the depth of the border.
inline constexpr int kExtrapolationCameras = 8;

// Finds the area of a view that must be extrapolated because it is beside the camera mesh. The result has one flag for
// each cell of a WeightGrid, row by row, which says whether the cell contains a pixel without an owner. It is empty if
// all pixels have an owner. `runs` must cover the whole view and only contain faces of the mesh.
std::vector<uint8_t> cells_beside_mesh(const FaceRuns& runs);

// Returns the weights of the cameras in `cells` (see cells_beside_mesh()). Returns null if no camera sees any of these
// pixels, for example if the view looks away from the array. `plan` has the faces of the mesh.
std::shared_ptr<const WeightGrid> extrapolated_weights(const Rig& rig, const Mesh& mesh, const ViewPlan& plan,
                                                       std::vector<uint8_t> cells, const ParallelFor& parallel);

}  // namespace lf
