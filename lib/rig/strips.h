// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>
#include <vector>

#include "rig/mesh.h"
#include "rig/plane_coordinates.h"

namespace lf {

// The faces of cameras that make no triangle: strips of neighbours along the line that fits best, in order, beginning
// at the end with the lower index; of cameras at the same place along it (to a quantum) the lowest index counts. A
// point where only one place is left; nothing without cameras.
// `in_service`: ascending. The extent is perpendicular to the line and to the cameras' mean forward axis; where these
// two are parallel, as near as can be to the cameras' mean down axis.
std::vector<MeshFace> make_strips(const Rig& rig, std::span<const CameraIndex> in_service,
                                  const CameraCentres& centres);

}  // namespace lf
