// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "rig/rig.h"

namespace lf {

// First rigs, as make_grid_rig() makes them, for cameras mounted in other shapes. A row of cameras is a grid of one
// row.

// Cameras on an arc of a circle, at one height, that all look at its centre; camera 0 is the left one. The world is
// that of the arc's middle: the centre lies at (0, 0, radius). Views blend along the arc, as along a row.
struct ArcRigOptions {
  int cameras = 0;
  double pitch = 0;   // metres between neighbours, along the straight line
  double radius = 0;  // metres; the arc must be less than half a circle
  double fov_y_deg = 0;
  int width = 640, height = 480;  // pixels
};
// Throws Error ("pitch: must be positive").
Rig make_arc_rig(const ArcRigOptions& options);

// Cameras on a circle in the plane z = 0 that all look along +z, as a ring light does. Camera 0 is at the top, the
// others follow clockwise as the cameras see it. Their mesh is the circle's Delaunay triangulation.
struct RingRigOptions {
  int cameras = 0;    // three at least
  double radius = 0;  // metres
  double fov_y_deg = 0;
  int width = 640, height = 480;  // pixels
};
// Throws Error ("radius: must be positive").
Rig make_ring_rig(const RingRigOptions& options);

}  // namespace lf
