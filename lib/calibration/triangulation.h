// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "calibration/adjustment.h"

namespace lf {

// Lists of observations: of each position, or of each camera, as indices.
std::vector<std::vector<uint32_t>> observations_of_positions(const Tracks& tracks);
std::vector<std::vector<uint32_t>> observations_of_cameras(const Tracks& tracks);

// A light of one place from the cameras that are used, mistaken ones among its `observations` (indices into the
// tracks', of one light). Nothing where no two of them agree to `threshold` pixels on a point in front of them.
struct Triangulated {
  Vec3 point;
  double agreement = 0;  // how many sights agree, softly
};
std::optional<Triangulated> triangulate(const std::vector<CameraState>& cameras, const Tracks& tracks,
                                        const std::vector<uint32_t>& observations, double threshold);

// Every target of the scene anew where that agrees with more sights than it does now. Targets of a bar become bars
// where both lights are found: of unit length, so the scene must be in that scale already.
void triangulate_targets(Reconstruction& scene, const Tracks& tracks, double threshold);

}  // namespace lf
