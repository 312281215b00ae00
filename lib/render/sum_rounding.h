// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>

#include "render/fragment.h"
#include "render/sum_planes.h"

namespace lf {

// From 8 bits to sums in 16 and back. The loops are free of branches and of aliasing, so that the compiler makes vector
// code of them.

// A weight of n / 255, in units of 1 / kLostOne: n * 32768 / 255 to the nearest, exact for all n.
inline uint16_t widen_lost(uint8_t n) { return static_cast<uint16_t>(128 * n + (n + 1) / 2); }

// To the nearest level, halves up, without leaving 16 bits on the way.
inline int16_t round_sum(int16_t sum) { return static_cast<int16_t>(((sum >> (kSumFractionBits - 1)) + 1) >> 1); }

inline void round_row(uint8_t* __restrict out, const int16_t* __restrict sum, int n) {
  for (int i = 0; i < n; i++) out[i] = static_cast<uint8_t>(std::clamp<int16_t>(round_sum(sum[i]), 0, 255));
}
// `offset` 128: as in pictures, 0: as in fragments.
inline void round_chroma_row(uint8_t* __restrict out, const int16_t* __restrict sum, int n, int16_t offset) {
  for (int i = 0; i < n; i++) out[i] = static_cast<uint8_t>(std::clamp<int16_t>(round_sum(sum[i]), -128, 127) + offset);
}
inline void round_lost_row(uint8_t* __restrict out, const uint16_t* __restrict lost, int n) {
  for (int i = 0; i < n; i++)
    out[i] = static_cast<uint8_t>((std::min<int>(lost[i], kLostOne) * 255 + kLostOne / 2) / kLostOne);
}

// Saturated to 8 bits; without a plane of lost weight where all of it rounds to 0.
Fragment rounded_fragment(CameraIndex camera, const ConstSumPlanes& sums);

}  // namespace lf
