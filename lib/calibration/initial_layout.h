// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "base/maths.h"
#include "calibration/adjustment.h"

namespace lf {

// The position of a light in one camera, in normalised coordinates (x/z and y/z of the ray).
struct ColumnDetection {
  uint32_t camera, column;
  Vec2 uv;
};

// Estimates the layout of a planar array of parallel cameras by a factorisation of rank 4. Such cameras see a point (x,
// y, z) at
//   uv = (x, y)/z - C 1/z + o,  C: camera position on the plane, o: small rotation,
// which is linear in a = (x, y)/z and d = 1/z. Missing entries and outliers are tolerated. Gauge: C has zero mean and
// unit spread; o has zero mean and no component proportional to C.
struct DisparityFactors {
  struct CameraFactor {
    Vec2 centre{0, 0}, turn{0, 0};
    double inliers = 0;  // share of inliers; 0: the camera is unknown
  };
  struct ColumnFactor {
    Vec2 direction{0, 0};
    double disparity = 0;
    bool known = false;
  };
  std::vector<CameraFactor> cameras;
  std::vector<ColumnFactor> columns;
  double inliers = 0;  // share of all detections that fit within `threshold`
};

// Estimates the layout from the detections in `sights`. `threshold` is the maximum error of an inlier in normalised
// coordinates. It must allow for lens errors and camera roll, because the model has neither.
DisparityFactors factorise_disparities(const std::vector<ColumnDetection>& sights, size_t num_cameras,
                                       size_t num_columns, double threshold);

// The functions below estimate the first poses and light positions, without a guess. Lenses are taken from the scene.
// Cameras that cannot be placed stay unused.

// Places an array of roughly parallel cameras near a plane. Returns the share of inliers of the detections.
double layout_from_disparities(Reconstruction& scene, const Tracks& tracks);

// Places the cameras of any rig (global structure from motion): essential matrices of many pairs, then rotation
// averaging, then all positions at once from the rays. The remaining cameras are resected (placed from light positions
// that are already known). Returns the number of placed cameras.
int global_layout(Reconstruction& scene, const Tracks& tracks, double threshold);

// Places the cameras of any rig (incremental structure from motion). Starts with the best pair by its essential matrix,
// then adds single cameras by resection. Returns the number of placed cameras.
int incremental_layout(Reconstruction& scene, const Tracks& tracks, double threshold);

// Triangulates the lights from the poses of the cameras. If the lights are on bars, the scene is scaled so that each
// bar has unit length.
void triangulate_from_poses(Reconstruction& scene, const Tracks& tracks, double threshold);

// Places cameras that do not take part yet, from the positions of lights that they see (resection). Returns the number
// of placed cameras.
int resect_cameras(Reconstruction& scene, const Tracks& tracks, double threshold);

}  // namespace lf
