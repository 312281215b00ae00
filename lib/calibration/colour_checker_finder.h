// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "calibration/colour_samples.h"

namespace lf {

// Samples of the 24 patches of a colour chart (image/colour_checker.h) that OpenCV's mcc module finds in an RGB image,
// in any orientation: patches `first_patch` (a multiple of 24) to first_patch + 23, those of them that are in the
// image. Empty where there is no chart, or one that is smaller than 60 pixels.
std::vector<ColourSample> find_colour_checker(const Image& rgb, CameraIndex camera, uint32_t first_patch);

// Of the charts that one camera was shown, `samples` in their order, takes out those that follow the chart's colours
// less well than most: patches are not where they were looked for. Nothing is taken out of less than three charts.
void leave_out_misread_charts(std::vector<ColourSample>& samples);

}  // namespace lf
