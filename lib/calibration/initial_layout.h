// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "base/maths.h"
#include "calibration/adjustment.h"

namespace lf {

// A light position seen by one camera, in normalised coordinates (x/z, y/z of the ray).
struct ColumnDetection {
  uint32_t camera, column;
  Vec2 uv;
};

// Rank-4 factorisation of a planar array. Parallel cameras on a plane see a point (x, y, z) at
//   uv = (x, y)/z - C 1/z + o,  C: camera position on the plane, o: small rotation,
// which is linear in a = (x, y)/z and d = 1/z. The factorisation tolerates missing entries and outliers. Gauge: C has
// zero mean and unit spread; o has zero mean and no component proportional to C.
struct DisparityFactors {
  struct CameraFactor {
    Vec2 centre{0, 0}, turn{0, 0};
    double inliers = 0;  // share of inliers; 0: unknown
  };
  struct ColumnFactor {
    Vec2 direction{0, 0};
    double disparity = 0;  // 1/z > 0
    bool known = false;
  };
  std::vector<CameraFactor> cameras;
  std::vector<ColumnFactor> columns;
  double inliers = 0;  // share of all detections within `threshold`
};

// `threshold`: maximum error in normalised coordinates, including lens errors and camera roll.
DisparityFactors factorise_disparities(const std::vector<ColumnDetection>& sights, size_t num_cameras,
                                       size_t num_columns, double threshold);

// The functions below estimate initial poses and targets without a guess. Lenses are taken from the scene. Cameras that
// cannot be placed stay unused.

// Places an array of roughly parallel cameras near a plane. Returns the inlier share of the detections.
double layout_from_disparities(Reconstruction& scene, const Tracks& tracks);

// Places the cameras of any rig (global SfM): essential matrices of many pairs, rotation averaging, then all positions
// at once from the rays. Cameras that remain are resected. Returns the number of placed cameras.
int global_layout(Reconstruction& scene, const Tracks& tracks, double threshold);

// Places the cameras of any rig (incremental SfM): the best pair by its essential matrix, then one camera after the
// other by resection. Returns the number of placed cameras.
int incremental_layout(Reconstruction& scene, const Tracks& tracks, double threshold);

// Triangulates targets for given poses. If there are bars, scales the scene to unit bar length.
void triangulate_from_poses(Reconstruction& scene, const Tracks& tracks, double threshold);

// Places unused cameras by resection from targets. Returns the number of placed cameras.
int resect_cameras(Reconstruction& scene, const Tracks& tracks, double threshold);

}  // namespace lf
