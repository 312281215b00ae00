// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "rig/rig.h"
#include "rig/triangulation.h"

namespace lf {

// A face of the camera mesh: a triangle of three cameras. If the cameras form no triangle, faces are *strips* or a
// *point*. A strip has two neighbouring cameras of a line and extends infinitely along `extent`, so its weights vary
// only along the line. A point is a single camera with weight 1 for every line of sight.
struct MeshFace {
  static constexpr CameraIndex kNone = UINT32_MAX;
  std::array<CameraIndex, 3> camera{kNone, kNone, kNone};  // unused corners are at the end
  Vec3 extent{0, 0, 0};                                    // strips only: unit vector in the world
  int corners() const { return camera[2] != kNone ? 3 : camera[1] != kNone ? 2 : 1; }
};

// The triangulation of the array on which blending weights are defined. A face's number is its index in `faces`.
struct Mesh {
  std::vector<MeshFace> faces;
};

// Builds the mesh. The result depends only on the arguments and is the same on every machine: centres are quantised to
// integer plane coordinates, predicates are exact, and the lowest index breaks ties.
//  - grid: each cell with corners a, a+1 / a+C, a+C+1 is split into (a, a+1, a+C) and (a+1, a+C+1, a+C), cell by cell.
//  - triangles: as listed.
//  - delaunay: the cameras in service, projected onto the best-fit plane of all cameras. Cocircular cameras become
//    a fan from the lowest index. Of coincident cameras, only the lowest index is used. Triangles start at their
//    lowest index, turn from the plane's x (right) to its y (down), and are sorted.
//  - holes (grid, triangles): cameras out of service are removed in ascending order. Each hole is filled by clipping
//    ears in its local plane (at the border: along the chain of neighbours), see remove_camera(). Remaining faces keep
//    their order; new faces follow in the order of filling.
//  - if no triangle with area is left: strips or a point, see make_strips(). No faces without cameras.
// Triangles without area (collinear or duplicate cameras) stay in the mesh; almost no line of sight meets such a
// triangle. Thread-safe. Takes a few milliseconds for 1024 cameras. Throws Error for an index in `out_of_service` or
// the topology that is not in the rig, a grid of the wrong size, and a non-finite position.
Mesh build_mesh(const Rig& rig, const CameraSet& out_of_service = {});

// Returns the outermost cameras: the corners of the convex hull of all centres in their best-fit plane, the ends of a
// line, or a single camera. Ascending; among coincident cameras the lowest index. Throws Error for a non-finite
// position.
CameraSet hull_cameras(const Rig& rig);

// Returns the cameras of `lost` (ascending) to leave out of the mesh, so that their neighbours close the gaps. Hull
// corners (see hull_cameras()) stay in the mesh although they contribute nothing: other cameras fill in for the missing
// weight, and the border of the array does not move to a viewer in the middle when half of the array is lost. With
// fewer than three working cameras, returns all of `lost`, because strips and points have no border.
CameraSet mesh_exclusions(const CameraSet& lost, const CameraSet& corners, size_t num_cameras);

// Caches the mesh of a rig for the most recent out-of-service set, because sets change rarely. Not thread-safe.
class MeshCache {
 public:
  const Mesh& get(const Rig& rig, const CameraSet& out_of_service);
  void clear() { mesh_.reset(); }

 private:
  CameraSet out_of_service_;
  std::optional<Mesh> mesh_;
};

// Returns the faces of cameras that form no triangle: strips of neighbours along the best-fit line, starting at the end
// with the lower index. Among cameras at the same position on the line (to a quantum), only the lowest index is used. A
// single position makes a point; no cameras make no faces. `in_service`: ascending. The extent is perpendicular to the
// line and to the cameras' mean forward axis. If line and mean forward axis are parallel, the extent is as close as
// possible to the cameras' mean down axis.
std::vector<MeshFace> make_strips(const Rig& rig, std::span<const CameraIndex> in_service,
                                  const CameraCentres& centres);

// Checks that a mesh suits the viewing directions of its cameras. A line of sight is blended between the cameras of the
// face that it crosses, so a face stays black if its cameras look along the face instead of through the face.

// Returns the share of triangles, 0..1, with cameras that look through them, ignoring slivers. Returns 1 for a mesh
// without triangles: strips and points suit every direction.
double share_facing_cameras(const Rig& rig, const Mesh& mesh);

// Replaces a Delaunay topology that does not suit the cameras, and returns notes about the change:
// - a row or an arc that is flatter than a tenth of the camera distance: no triangles, so the mesh is strips;
// - cameras around a centre, looking at the centre or away from it: the Delaunay triangulation on a sphere around the
//   centre, without faces that their cameras do not look through (the open ends of a cylinder, the bottom of a dome).
// Any other rig stays unchanged, with a note if at least half of its cameras do not look through its faces.
std::vector<std::string> fit_topology(Rig& rig);

// A grid with cells that are not side by side in space, for example because its cameras are in the wrong order.
struct GridFault {
  size_t folded = 0, triangles = 0;  // number of flat or reversed triangles, and of all triangles
  std::string text;                  // sentence that names the first folded triangle
};
// Returns nullopt for a good grid, for a grid with a single row or column, and for other topologies.
std::optional<GridFault> find_grid_fault(const Rig& rig);

}  // namespace lf
