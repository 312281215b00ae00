// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "geometry/pose.h"
#include "rig/mesh.h"
#include "rig/rig.h"
#include "view/view.h"

namespace lf {

// Returns the reference plane for distances in the focal maps of an array: through the mean of the camera centres,
// normal to the mean of the axes. Requires at least one camera. If the axes cancel out, the first camera's axis is
// normal.
Plane array_plane(const Rig& rig);

// Depth resolution of an array, computed from its geometry. Not thread-safe.
class FocusArray {
 public:
  // An array with unknown geometry, except for its reference plane. Implicit, for callers without a rig.
  FocusArray(const Plane& from) : from_(from) {}  // NOLINT(google-explicit-constructor)
  // The rig must have a camera and must outlive the object.
  explicit FocusArray(const Rig& rig);
  // An array with views blended by this mesh, regardless of the cameras out of service. The mesh must outlive the
  // object.
  FocusArray(const Rig& rig, const Mesh& mesh);

  // Returns the reference plane for distances in focal maps: see array_plane().
  const Plane& from() const { return from_; }
  // Returns the largest inverse distance, 1/m, that leaves neighbouring cameras three quarters of their images in
  // common. Searches stop there. 0: unknown.
  double nearest() const { return nearest_; }
  // Returns the disparity between cameras one edge() apart, in pixels of a camera's image per 1/m. 0: unknown, or there
  // is a single camera.
  double disparity() const { return disparity_; }
  // Returns the median distance from a camera to the nearest other one, metres. 0: unknown.
  double spacing() const { return spacing_; }
  // Returns the median distance between cameras that contribute to the same pixel, metres: in a grid the spacing,
  // otherwise the mesh edge, which is longer. 0: unknown.
  double edge() const { return edge_; }
  // Returns the width of the group of cameras that contribute to a pixel of the view, metres: one edge, or for views
  // blended by angle twice the lateral distance from the viewpoint to the last camera used for hypotheses. Lines of
  // sight beside the mesh count for an edge plus twice their distance to the nearest camera. 0: unknown. The view must
  // have a map.
  double width_of(const View& view, const CameraSet& out_of_service) const;
  // Returns the median focal length of the cameras, pixels. 0: unknown.
  double focal() const { return focal_; }
  bool is_known() const { return rig_ != nullptr; }

  // Returns 1 for each node of the view's map that the mesh covers, and 0 for nodes beside the mesh, which are
  // extrapolated. Empty if there are no such nodes, or the view is not blended by the mesh.
  std::vector<uint8_t> inside_mesh(const View& view, const CameraSet& out_of_service) const;

  // Returns the evidence at each node of the view's map: how clearly its sums can show a disagreement between the
  // cameras. It is the square root of 1 - sum w^2 for the weights w of the hypothesis view, divided by that root for
  // three equal weights. It is 0 where one camera has all the weight, because every depth looks the same there, and 0
  // where no camera has a weight. Without a rig it is 1 everywhere.
  //
  // Weights are continuous, so the evidence is computed at every kApart-th node (views blended by angle: at the points
  // of their WeightGrid) and interpolated bilinearly. Throws Error if `out_of_service` has a camera that is not in the
  // rig.
  static constexpr int kApart = 4;
  std::vector<float> evidence(const View& view, const CameraSet& out_of_service) const;

 private:
  FocusArray(const Rig& rig, const Mesh* mesh);
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
