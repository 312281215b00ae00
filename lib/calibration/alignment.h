// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "geometry/pose.h"

namespace lf {

// b_from_a between two frames: rotation, uniform scale and shift.
struct Similarity {
  double scale = 1;
  Quat rotation{1, 0, 0, 0};
  Vec3 translation{0, 0, 0};

  Vec3 operator()(const Vec3& point) const { return scale * (rotation * point) + translation; }
  Pose operator()(const Pose& pose) const {
    return {(*this)(pose.position), glm::normalize(rotation * pose.orientation)};
  }
};

// How much a radian counts beside a distance of the size of the array: nearly nothing, so that alignment is that of the
// centres; but where these leave a turn open (cameras in one row, or two) the orientations decide.
inline constexpr double kTurnWeight = 1e-3;

// The root of the mean squared distance from the mean.
double spread(const std::vector<Vec3>& points);

// The similarity that takes poses `a` nearest to poses `b` (least squares of the centres: Umeyama 1991). Pairs by
// index; two at least. `fixed_scale`: scale 1.
Similarity align(const std::vector<Pose>& a, const std::vector<Pose>& b, bool fixed_scale = false);

}  // namespace lf
