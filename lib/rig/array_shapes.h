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

// Rows of cameras around an upright cylinder, evenly, that look at its axis or away from it. Row 0 is the top one, and
// in each row cameras follow to the right as they see it. The world is that of camera 0's column: it looks along +z,
// from (0, y, 0) at the axis, which is at (0, radius) in x and z, or from (0, y, radius) away from the one at (0, 0);
// the rows' middle is at y = 0. The mesh closes around the cylinder, so that every line of sight that passes between
// two rows has its triangle.
struct CylinderRigOptions {
  int rows = 0, columns = 0;  // two and three at least
  double pitch = 0;           // metres between rows
  double radius = 0;          // metres
  bool inward = true;
  double fov_y_deg = 0;
  int width = 640, height = 480;  // pixels
};
// Throws Error ("radius: must be positive").
Rig make_cylinder_rig(const CylinderRigOptions& options);

}  // namespace lf
