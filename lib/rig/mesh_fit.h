// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rig/mesh.h"
#include "rig/rig.h"

namespace lf {

// Whether a mesh suits the directions that its cameras look in. A line of sight is blended between the cameras of the
// face that it passes through. So cameras must look through their faces: a face that they look along stays black.

// The share of triangles, 0..1, that their cameras look through. Slivers do not count. 1 where the mesh has no
// triangles: strips and points suit every direction.
double share_looked_through(const Rig& rig, const Mesh& mesh);

// Replaces a Delaunay topology that does not suit the cameras, and returns notes that say so:
// - a row or an arc, flatter than a tenth of the distance of neighbours: no triangles, so the mesh is strips;
// - cameras around a centre, which look at it or away from it: the Delaunay triangulation on the sphere around that
//   centre, without the faces that cameras do not look through (the open ends of a cylinder, the bottom of a dome).
// Any other rig stays as it is, with a note where half of its cameras or more do not look through its faces.
std::vector<std::string> fit_topology(Rig& rig);

// What is wrong with a grid whose cells do not lie side by side in space, as when its cameras are in the wrong order.
struct GridFault {
  size_t folded = 0, triangles = 0;  // triangles that are flat or turned over, of all
  std::string text;                  // a sentence that names the first
};
// Nothing for a good grid, for one of a single row or column, and for other topologies.
std::optional<GridFault> find_grid_fault(const Rig& rig);

}  // namespace lf
