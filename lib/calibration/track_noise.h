// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "calibration/adjustment.h"

namespace lf {

// Feature tracks are not alike: one follows a printed corner to three hundredths of a pixel, another an edge, the rim
// of something round or a highlight to a half. Sets the sigma of all observations of a track to what its residuals
// show, over that of the median track; few residuals are helped by that median.
void estimate_track_noise(const Scene& scene, Tracks& tracks);

}  // namespace lf
