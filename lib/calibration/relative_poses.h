// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "calibration/adjustment.h"

namespace lf {

// Camera b as camera a sees it, from what both saw of the light: `a_from_b` with a distance of 1, which nothing tells.
struct RelativePose {
  size_t a = 0, b = 0;
  Pose a_from_b;
  double score = 0;  // sights that fit, for more where they cross at a wide angle
};

// Of those pairs of cameras that share most, so that each camera has several partners, by their essential matrices (the
// lenses are those in the scene). `threshold`: pixels.
std::vector<RelativePose> relative_poses(const Scene& scene, const Tracks& tracks, double threshold);

}  // namespace lf
