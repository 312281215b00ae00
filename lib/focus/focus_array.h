// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "geometry/pose.h"
#include "rig/mesh.h"
#include "rig/rig.h"
#include "view/view.h"

namespace lf {

// The plane that focal maps of an array count distances from: it goes through the mean of its centres, normal to the
// mean of its axes. Requires at least one camera; cameras that look in opposite directions give the first one's axis.
Plane array_plane(const Rig& rig);

// What geometry alone says of how well an array can tell depths apart. Not thread-safe.
class FocusArray {
 public:
  // An array of which only the plane that distances are counted from is known. Implicit, for callers without a rig.
  FocusArray(const Plane& from) : from_(from) {}  // NOLINT(google-explicit-constructor)
  // The rig must outlive this and have a camera.
  explicit FocusArray(const Rig& rig);
  // An array whose views are blended by this mesh, which must outlive this, whichever cameras are out of service.
  FocusArray(const Rig& rig, const Mesh& mesh);

  // What focal maps count distances from: see array_plane().
  const Plane& from() const { return from_; }
  // The largest inverse distance, 1/m, at which neighbouring cameras have three quarters of their images in common:
  // nothing nearer is looked for. 0: not known.
  double nearest() const { return nearest_; }
  // By how many pixels of a camera's image the ends of an edge() differ for each 1/m. 0: not known, or there is no
  // second camera.
  double disparity() const { return disparity_; }
  // Metres from a camera to the next one, the median; 0: not known.
  double spacing() const { return spacing_; }
  // Metres between cameras that make a pixel together, the median: in a grid the spacing, elsewhere an edge of the
  // mesh, which is longer; 0: not known.
  double edge() const { return edge_; }
  // Metres across the cameras that make a pixel of the view, seen from its eye: an edge, or for views blended by angle
  // twice the distance to the last of the trials' cameras beside the eye. 0: not known.
  double width_of(const View& view) const;
  // The focal length of the cameras, pixels, the median; 0: not known.
  double focal() const { return focal_; }
  bool is_known() const { return rig_ != nullptr; }

  // Returns for each node of the view's map how well its moments can show a disagreement between the cameras: the
  // square root of 1 - sum w^2, divided by that root for three equal weights w of the trial view. The evidence is 0
  // where one camera has all the weight, because every depth looks the same there, and 0 where no camera has a weight.
  // Without a rig the evidence is 1 everywhere. Weights are continuous, so the evidence is computed at every kApart-th
  // node (views blended by angle: at the points of their BlendGrid) and bilinear in between. Throws Error for cameras
  // out of service that the rig does not have.
  static constexpr int kApart = 4;
  std::vector<float> evidence(const View& view, const CameraSet& out_of_service) const;

 private:
  FocusArray(const Rig& rig, const Mesh* mesh);

  Plane from_;
  double nearest_ = 0, disparity_ = 0, spacing_ = 0, edge_ = 0, focal_ = 0;
  const Rig* rig_ = nullptr;
  const Mesh* given_mesh_ = nullptr;
  mutable MeshCache mesh_;
};

}  // namespace lf
