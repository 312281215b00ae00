// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "geometry/pose.h"
#include "rig/mesh.h"
#include "rig/rig.h"
#include "view/view.h"

namespace lf {

// Returns the reference plane of an array: its focal maps contain distances from this plane. The plane passes through
// the mean of the camera centres, and its normal is the mean of the camera axes. If the axes cancel out, the first
// camera's axis is the normal. The rig must have at least one camera.
Plane array_plane(const Rig& rig);

// Returns the median length of the mesh edges, in metres; 0 without edges.
double median_edge(const Rig& rig, const Mesh& mesh);

// Describes how well an array can measure depth in a view, computed from the geometry of the cameras. DepthEstimator
// uses it to choose the range and the distances of depth hypotheses, and to ignore nodes without information. Not
// thread-safe.
class FocusArray {
 public:
  // Creates an array with unknown geometry, except for its reference plane. The constructor is implicit, for callers
  // without a rig.
  FocusArray(const Plane& from) : from_(from) {}  // NOLINT(google-explicit-constructor)
  // Creates an array from a rig, which must have a camera and outlive this object. If `mesh` is not null, views are
  // blended by this mesh, regardless of the cameras out of service. The mesh must then outlive this object.
  explicit FocusArray(const Rig& rig, const Mesh* mesh = nullptr);

  // Returns the reference plane for distances in focal maps: see array_plane().
  const Plane& from() const { return from_; }
  // Returns the largest inverse distance, in 1/m, where neighbouring cameras still share three quarters of their
  // images. Searches stop there. 0: unknown.
  double nearest() const { return nearest_; }
  // Returns the disparity between two cameras at the distance edge(), in pixels of a camera image for each 1/m of
  // inverse distance. 0: unknown, or there is a single camera.
  double disparity() const { return disparity_; }
  // Returns the difference in level of a map that changes this disparity by a pixel. Returns 8 if the disparity is
  // unknown.
  double levels_a_pixel(const FocalMap& map) const {
    return disparity_ > 0 ? FocalMap::kLevels / (disparity_ * (map.nearest - map.farthest)) : 8;
  }
  // Returns the median distance from a camera to its nearest neighbour, in metres. 0: unknown.
  double spacing() const { return spacing_; }
  // Returns the median distance between cameras that contribute to the same pixel, in metres. For a grid of cameras
  // this is spacing(), otherwise the median mesh edge, which is longer. 0: unknown.
  double edge() const { return edge_; }
  // Returns the width of the group of cameras that contribute to a pixel of the view, in metres. The width determines
  // how much a wrong depth blurs or displaces an object. It is edge() or, for views blended by angle, twice the lateral
  // distance from the viewpoint to the last camera used for hypotheses. For lines of sight beside the mesh, the width
  // is edge() plus twice the distance to the nearest camera. 0: unknown. The view must have a map.
  double width_of(const View& view, const CameraSet& out_of_service) const;
  // Returns the median focal length of the cameras, pixels. 0: unknown.
  double focal() const { return focal_; }
  bool is_known() const { return rig_ != nullptr; }

  // Returns 1 for each node of the view's map that the mesh covers, and 0 for nodes beside the mesh, which are
  // extrapolated. Empty if there are no such nodes, or the view is not blended by the mesh.
  std::vector<uint8_t> inside_mesh(const View& view, const CameraSet& out_of_service) const;

  // Returns the evidence at each node of the view's map, 0 to about 1: how clearly the sums at the node can show that
  // the cameras disagree. It is 1 if three cameras have equal weights. It is 0 if one camera has all the weight,
  // because every depth then looks the same, and 0 if no camera has a weight. For weights w of the hypothesis view, it
  // is sqrt(1 - sum w^2), divided by the same root for three equal weights. Without a rig it is 1 everywhere.
  //
  // Weights change continuously, so the evidence is computed at every kApart-th node only, and interpolated bilinearly.
  // For views blended by angle, it is computed at the points of their WeightGrid. Throws Error if `out_of_service` has
  // a camera that is not in the rig.
  static constexpr int kApart = 4;
  std::vector<float> evidence(const View& view, const CameraSet& out_of_service) const;

 private:
  static View sparse_view(const View& view);
  double width_beside_mesh(const View& view, const CameraSet& out_of_service) const;
  const Mesh& mesh_without(const CameraSet& out_of_service) const;

  Plane from_;
  double nearest_ = 0, disparity_ = 0, spacing_ = 0, edge_ = 0, focal_ = 0;
  const Rig* rig_ = nullptr;
  const Mesh* given_mesh_ = nullptr;
  mutable MeshCache mesh_;
};

}  // namespace lf
