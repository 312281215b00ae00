// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "rig/plane_coordinates.h"
#include "rig/triangle.h"

namespace lf {

// Takes `camera` out of the mesh `faces`: the triangles around it go, the rest keep their order, and the triangles that
// fill the hole are appended in order of clipping (see clip_ears()). They turn as the ones they replace.
// The hole is filled in its local plane, normal to the sum of the area vectors of the triangles it had (parallel to
// `plane` where that sum vanishes), quantised with the array's quantum. Where the camera was at the border of the mesh
// its neighbours' chain is filled where it has bays, clear of what else of the mesh lies there. Where the mesh around
// the camera is not a surface the hole stays.
// `plane`: the best-fit plane of `centres`.
void remove_camera(std::vector<Triangle>& faces, CameraIndex camera, const CameraCentres& centres,
                   const PlaneAxes& plane);

}  // namespace lf
