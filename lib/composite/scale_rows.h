// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "render/sum_planes.h"

// Dividing sums by what is left of a pixel's weight. Rows of `n` values do not overlap; the same result with every
// instruction set.
namespace lf {

// With less valid weight than this (of kLostOne) a pixel shows the background: 3/255, rounded up.
inline constexpr int kLeastWeight = (3 * kLostOne + 254) / 255;

// What a pixel becomes is sum * scale, in levels; 0 where too much was lost.
void make_scales(float* scale, const uint16_t* lost, int n);

// sum * scale, or `background` where scale is 0, to the nearest of 0..255, halves up: exact in float wherever the
// result is not cut off, up to the rounding of the scale itself (2^-23 of the value).
void scale_row(uint8_t* out, const int16_t* sum, const float* scale, float background, int n);

}  // namespace lf
