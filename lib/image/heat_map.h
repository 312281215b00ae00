// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <span>

#include "image/image.h"

namespace lf {

// The colour of a share of a scale, R, G, B: from black at 0 over violet, red and orange to pale yellow at 1, always
// brighter (the scale "inferno" of matplotlib, S. van der Walt and N. Smith 2015), so that it means the same in grey
// and to the colour-blind. Shares beyond 0..1 count as 0 and 1.
std::array<uint8_t, 3> heat_colour(double share);

// What has no value in a heat map: a grey that is no colour of the scale.
inline constexpr uint8_t kNoHeat = 96;

// How much of the luma of a picture under it the black of a heat map lets through.
inline constexpr float kHeatUnderlay = 0.4f;

// Values as colours: width * height of them, row-major; 0 is black and `full` the end of the scale; NaN is kNoHeat.
// `underlay` (RGB, of that size) shows dimly through by its luma where values are small. Throws Error for another size.
Image heat_map(std::span<const float> values, int width, int height, double full, const Image* underlay = nullptr);

}  // namespace lf
