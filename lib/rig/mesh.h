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

// A face of the camera mesh. A triangle has three cameras. A rig whose cameras make no triangle still has faces: a
// *strip* of two cameras (collinear rigs: neighbours along the line; the face extends without end along `extent`, so
// weights vary along the line of cameras alone), or a *point* of one camera (weight 1 for every line of sight).
struct MeshFace {
  static constexpr CameraIndex kNone = UINT32_MAX;
  std::array<CameraIndex, 3> camera{kNone, kNone, kNone};  // unused corners are kNone, at the end
  Vec3 extent{0, 0, 0};                                    // strips only: unit vector in the world
  int corners() const { return camera[2] != kNone ? 3 : camera[1] != kNone ? 2 : 1; }
};

// The triangulation of the array that blending weights live on; a face's number is its place in `faces`.
struct Mesh {
  std::vector<MeshFace> faces;
};

// A function of (rig, out of service) alone and the same on every machine: centres are quantised to integers in plane
// coordinates, predicates on them are exact, ties go to the lowest index.
//  - grid: each cell with corners a, a+1 / a+C, a+C+1 is split into (a, a+1, a+C) and (a+1, a+C+1, a+C), cell by cell.
//  - triangles: as listed.
//  - delaunay: of the cameras in service, projected onto the best-fit plane of all cameras; among cocircular
//    candidates the diagonal with the lowest index (a polygon of more becomes the fan from its lowest index); of
//    coincident cameras the lowest index counts, the others are in no face. Triangles begin at their lowest index,
//    turn from the plane's x (right) to its y (down), and are sorted.
//  - holes (grid, triangles): cameras out of service are taken out one by one in ascending order and the hole each
//    leaves is filled by clipping ears in its local plane (the chain of its neighbours, where it was at the border),
//    see remove_camera(). The faces that remain keep their order, the new ones follow in order of filling.
//  - where no triangle with area is left: strips of neighbours along the line that fits the cameras in service best,
//    numbered from its end with the lower index; of cameras at one place along it the lowest index counts; one place
//    makes a point (see make_strips()). No faces without cameras.
// Triangles without area (three cameras on a line, duplicates) stay beside others: no line of sight but a null set
// meets them. Pure; call from any thread. 1024 cameras take a few milliseconds.
// Throws Error for an index in `out_of_service` or in the topology that the rig does not have, a grid of another
// number of cameras, and a position that is not finite.
Mesh build_mesh(const Rig& rig, const CameraSet& out_of_service = {});

// The cameras that the array would see less without: the corners of the convex hull of all centres in their best-fit
// plane, the ends of a line, one camera that is alone. Ascending; of cameras at one place the one with the lowest
// index. Pure. Throws Error for a position that is not finite.
CameraSet corner_cameras(const Rig& rig);

// The cameras of `lost`, which ascend, that are to be out of service, so that their neighbours close the gaps. Corners
// (see corner_cameras()) stay in the mesh, though they give nothing: what they had a part in is shown by the others,
// and the view of somebody in the middle of the array is not at its border when half of it is lost. With less than
// three cameras that work, all are to be: strips and points have no border.
CameraSet out_of_mesh(const CameraSet& lost, const CameraSet& corners, size_t num_cameras);

// The mesh of a rig for the out-of-service set asked for last: sets change rarely. Not thread-safe.
class MeshCache {
 public:
  // Throws Error for cameras that the rig does not have.
  const Mesh& get(const Rig& rig, const CameraSet& out_of_service);
  void clear() { mesh_.reset(); }

 private:
  CameraSet out_of_service_;
  std::optional<Mesh> mesh_;
};

// The faces of cameras that make no triangle: strips of neighbours along the line that fits best, in order, beginning
// at the end with the lower index; of cameras at the same place along it (to a quantum) the lowest index counts. A
// point where only one place is left; nothing without cameras.
// `in_service`: ascending. The extent is perpendicular to the line and to the cameras' mean forward axis; where these
// two are parallel, as near as can be to the cameras' mean down axis.
std::vector<MeshFace> make_strips(const Rig& rig, std::span<const CameraIndex> in_service,
                                  const CameraCentres& centres);

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
