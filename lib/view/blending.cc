// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/blending.h"

#include <string>

#include "base/error.h"

namespace lf {

Blending blending_of(double aperture, int nearest) {
  if (aperture != 0) return {Blending::Kind::kAperture, aperture, 0};
  if (nearest != 0) return {Blending::Kind::kAngle, 0, nearest};
  return {};
}

void validate(const Blending& blending) {
  const bool wide = blending.kind == Blending::Kind::kAperture, by_angle = blending.kind == Blending::Kind::kAngle;
  if (wide ? !(blending.aperture > 0 && blending.aperture <= Blending::kMaxAperture) : blending.aperture != 0)
    throw Error(wide ? "blending: the aperture must be above 0, at most 1000000 m"
                     : "blending: has an aperture that its kind does not know");
  if (by_angle ? !(blending.nearest >= 1 && blending.nearest <= Blending::kMaxNearest) : blending.nearest != 0)
    throw Error(by_angle ? "blending: must be of the nearest 1 to " + std::to_string(Blending::kMaxNearest) + " cameras"
                         : "blending: has a number of cameras that its kind does not know");
}

}  // namespace lf
