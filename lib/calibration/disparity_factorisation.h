// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "base/vec.h"

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

}  // namespace lf
