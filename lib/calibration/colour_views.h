// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>

#include "calibration/colour_samples.h"

namespace lf {

// Samples of places of a scene in overlapping views, without a chart: of each reference camera's image windows of 9 x 9
// pixels that have texture, at the distance at which the other cameras' windows are most like them (a sweep of the
// normalised correlation, which knows nothing of brightness), in all cameras whose windows agree. The rig's geometry is
// calibrated. `images`: RGB, one a camera in the rig's order, of one instant, as they come; those of no size are left
// out. Throws Error for an image that is not of its camera's size.
ColourSamples sample_views(const Rig& rig, std::span<const Image> images);

}  // namespace lf
