// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "rig/rig.h"

namespace lf {

// A first rig for somebody who has just mounted cameras on a flat board: rows x columns of them, `pitch` metres apart,
// around the origin of the plane z = 0, looking along +z; row 0 is the top one, ids and names ("cam_00_00") row by row.
// All with the same lens: `fov_y_deg` is the vertical field of view, RADIAL without distortion, ready to be calibrated.
struct GridRigOptions {
  int rows = 0, columns = 0;
  double pitch = 0;
  double fov_y_deg = 0;
  int width = 640, height = 480;  // pixels
};

// Throws Error ("pitch: must be positive").
Rig make_grid_rig(const GridRigOptions& options);

}  // namespace lf
