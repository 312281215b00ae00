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

// A face of the camera mesh: usually a triangle of three cameras. Pixels with lines of sight that cross the face are
// blended from its corners.
//
// If the cameras form no triangle, the faces are *strips* or a *point*. A strip lies between two neighbouring cameras
// of a line. It extends infinitely along `extent`, so its weights vary only along the line. A point is a single camera,
// which has weight 1 for every line of sight.
struct MeshFace {
  static constexpr CameraIndex kNone = UINT32_MAX;
  std::array<CameraIndex, 3> camera{kNone, kNone, kNone};  // unused corners are at the end
  Vec3 extent{0, 0, 0};                                    // strips only: unit vector in the world
  int corners() const { return camera[2] != kNone ? 3 : camera[1] != kNone ? 2 : 1; }
};

// The camera mesh: the triangles between the cameras of an array. The line of sight of a pixel crosses one face of the
// mesh, and the pixel is blended from the cameras at the corners of that face. The number of a face is its index in
// `faces`.
struct Mesh {
  std::vector<MeshFace> faces;
};

// Builds the mesh. The result depends only on the arguments and is the same on every machine, because centres are
// quantised to integers, predicates are exact, and the lowest index breaks ties.
//
// Depending on the topology, the triangles are:
//  - grid: each cell with corners a, a+1 / a+C, a+C+1 is split into (a, a+1, a+C) and (a+1, a+C+1, a+C), cell by cell.
//  - triangles: as listed.
//  - delaunay: a triangulation of the cameras in service, projected onto the best-fit plane of all cameras. Cocircular
//    cameras become a fan from the lowest index. If cameras coincide, only the lowest index is used. Triangles start at
//    their lowest index, turn from the plane's x (right) to its y (down), and are sorted.
//
// In a grid or a list of triangles, each camera out of service leaves a hole. Cameras are removed in ascending order,
// and each hole is filled by clipping ears in its local plane (at the border: along the chain of neighbours); see
// remove_camera(). Remaining faces keep their order, and new faces follow in the order of filling. If no triangle with
// area is left, the faces are strips or a point (see make_strips()), or none without cameras.
//
// Triangles without area (collinear or coincident cameras) stay in the mesh; almost no line of sight meets such a
// triangle. Thread-safe. Takes a few milliseconds for 1024 cameras. Throws Error for a camera in `out_of_service` or
// the topology that is not in the rig, a grid of the wrong size, or a non-finite position.
Mesh build_mesh(const Rig& rig, const CameraSet& out_of_service = {});

// Returns the outermost cameras of an array, which may not leave the camera mesh because they define its border. They
// are the corners of the convex hull of all camera positions, projected onto the best-fit plane.
//
// If all cameras are on one line, the result is the two cameras at its ends. If all have the same position, it is a
// single camera. If cameras have the same position, only the lowest index is used. The result is in ascending order.
// Throws Error if a position is not finite.
CameraSet hull_cameras(const Rig& rig);

// Returns which of the cameras without images (`lost`, ascending) should leave the camera mesh, so that neighbouring
// cameras close the gaps. Corners of the hull (see hull_cameras()) stay in the mesh even without images, and other
// cameras take over their weight. Otherwise, the border of the array would move to a viewer in the middle when half of
// the array is lost.
//
// If fewer than three cameras work, returns all of `lost`, because strips and points have no border.
CameraSet mesh_exclusions(const CameraSet& lost, const CameraSet& corners, size_t num_cameras);

// Builds the camera mesh of a rig only when the set of out-of-service cameras changes, because building takes
// milliseconds. Call clear() if the rig changes. Not thread-safe.
class MeshCache {
 public:
  const Mesh& get(const Rig& rig, const CameraSet& out_of_service);
  void clear() { mesh_.reset(); }

 private:
  CameraSet out_of_service_;
  std::optional<Mesh> mesh_;
};

// Returns the faces of cameras that form no triangle, for example a single row. Neighbours along the best-fit line form
// strips, starting at the end with the lower index. If cameras have (almost) the same position on the line, only the
// lowest index is used. A single position makes a point; no cameras make no faces.
//
// `in_service` is ascending. The strips extend perpendicular to the line and to the mean forward axis of the cameras.
// If both are parallel, they extend as closely as possible to the mean down axis.
std::vector<MeshFace> make_strips(const Rig& rig, std::span<const CameraIndex> in_service,
                                  const CameraCentres& centres);

// Checks whether a camera mesh suits the viewing directions of its cameras. A pixel is blended from the cameras of the
// face that its line of sight crosses. If these cameras look along the face instead of through it, they do not see the
// scene behind the face, and its pixels stay black.

// Returns the share of the mesh area (0 to 1) in triangles with cameras that look through the triangle. Ignores very
// thin triangles. Returns 1 for a mesh without triangles, because strips and points suit every direction.
double share_facing_cameras(const Rig& rig, const Mesh& mesh);

// Replaces a Delaunay topology that does not suit the cameras, and returns notes about the change:
// - A row or an arc that is flatter than a tenth of the camera distance gets no triangles, so the mesh is strips.
// - Cameras around a centre, which look at the centre or away from it, get the Delaunay triangulation on a sphere
//   around the centre. Faces that their cameras do not look through are left out (the open ends of a cylinder, the
//   bottom of a dome).
// Any other rig stays unchanged, with a note if at least half of its cameras do not look through its faces.
std::vector<std::string> fit_topology(Rig& rig);

// Says how many cells of a grid are not side by side in space, which usually means that cameras are in the wrong order.
struct GridFault {
  size_t folded = 0, triangles = 0;  // number of flat or reversed triangles, and of all triangles
  std::string text;
};
// Checks the order of a grid's cameras. Returns nullopt if the grid is good or has a single row or column, and for
// other topologies.
std::optional<GridFault> find_grid_fault(const Rig& rig);

}  // namespace lf
