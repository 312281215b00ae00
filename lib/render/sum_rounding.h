// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>

#include "render/fragment.h"
#include "render/sum_planes.h"

namespace lf {

// From 8 bits to sums in 16 and back, to the nearest level, halves up, saturated. Rows of `n` values do not overlap;
// the same result with every instruction set.

// A weight of v / 255, in units of 1 / kLostOne: v * 32768 / 255 to the nearest, exact for all v.
inline uint16_t widen_lost(uint8_t v) { return static_cast<uint16_t>(128 * v + (v + 1) / 2); }
inline uint8_t round_lost(uint16_t lost) {
  return static_cast<uint8_t>((std::min<int>(lost, kLostOne) * 255 + kLostOne / 2) / kLostOne);
}

void round_row(uint8_t* out, const int16_t* sum, int n);
// `offset` 128: as in pictures, 0: as in fragments.
void round_chroma_row(uint8_t* out, const int16_t* sum, int n, uint8_t offset);
// Three rows to one of pixels; a fourth byte is set to 255.
void round_rgb_row(uint8_t* out, const RgbLayout& layout, const int16_t* r, const int16_t* g, const int16_t* b, int n);

// Without a plane of lost weight where all of it rounds to 0.
Fragment rounded_fragment(const ConstSumPlanes& sums);

}  // namespace lf
