// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "base/maths.h"
#include "calibration/adjustment.h"

namespace lf {

// A light of one place as one camera saw it: normalised coordinates (x/z, y/z of the line of sight).
struct ColumnSight {
  uint32_t camera, column;
  Vec2 uv;
};

// Cameras on a plane that look the same way see a point (x, y, z) at
//   uv = (x, y)/z - C 1/z + o,  C the camera's place on the plane, o a small turn:
// linear in a = (x, y)/z and d = 1/z, so that a table of sights has rank 4. Found from the entries there are, mistaken
// ones among them. Nothing fixes the size of C, or which turn is straight ahead: C has unit spread and zero mean, o has
// zero mean and no part that grows with C.
struct DisparityFactors {
  struct CameraFactor {
    Vec2 centre{0, 0}, turn{0, 0};
    double inliers = 0;  // share of its sights that fit; 0: unknown
  };
  struct ColumnFactor {
    Vec2 direction{0, 0};
    double disparity = 0;  // 1/z > 0
    bool known = false;
  };
  std::vector<CameraFactor> cameras;
  std::vector<ColumnFactor> columns;
  double inliers = 0;  // share of all sights that fit to `threshold`
};

// `threshold`: how far a sight may be off, normalised; lens errors and rolled cameras count as such.
DisparityFactors factorise_disparities(const std::vector<ColumnSight>& sights, size_t num_cameras, size_t num_columns,
                                       double threshold);

// These find first poses and targets without any guess of them. The lenses are those in the scene; cameras that could
// not be placed are left unused.

// Places an array whose cameras look about the same way from about a plane. Returns the share of the sights that fit.
double layout_from_disparities(Reconstruction& scene, const Tracks& tracks);

// Places the cameras of any rig: by essential matrices of many pairs, their rotations averaged, then all places at once
// from the lines of sight; then cameras that this missed, from what the others see. Returns how many were placed.
int layout_from_averages(Reconstruction& scene, const Tracks& tracks, double threshold);

// Places the cameras of any rig: the best pair by its essential matrix, then one camera after the other from what those
// see. Returns how many were placed.
int layout_from_a_pair(Reconstruction& scene, const Tracks& tracks, double threshold);

// Places targets for poses that are there already, with bars made of unit length where the tracks have bars.
void targets_from_poses(Reconstruction& scene, const Tracks& tracks, double threshold);

// Places unused cameras from the targets that they see. Returns how many were placed.
int resect_cameras(Reconstruction& scene, const Tracks& tracks, double threshold);

}  // namespace lf
