// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>

#include "render/sum_rounding.h"

// Adding one row to a row of sums, saturating, so that hostile input can't wrap. Sums of values that are not negative
// (all luma, RGB and lost weight) come out the same in any order even then. In 16 bits throughout and free of branches,
// so that the compiler makes vector code of them.
namespace lf {

inline int16_t add_saturated(int16_t a, int16_t b) {
  const auto high = static_cast<int16_t>(INT16_MAX - std::max<int16_t>(a, 0));
  const auto low = static_cast<int16_t>(INT16_MIN - std::min<int16_t>(a, 0));
  return static_cast<int16_t>(a + std::min(std::max(b, low), high));
}
inline uint16_t add_saturated(uint16_t a, uint16_t b) {
  return static_cast<uint16_t>(a + std::min(b, static_cast<uint16_t>(UINT16_MAX - a)));
}

// 8 bits.
inline void add_row(int16_t* __restrict sum, const uint8_t* __restrict in, int n) {
  for (int i = 0; i < n; i++) sum[i] = add_saturated(sum[i], static_cast<int16_t>(in[i] << kSumFractionBits));
}
inline void add_chroma_row(int16_t* __restrict sum, const uint8_t* __restrict in, int n) {
  for (int i = 0; i < n; i++)
    sum[i] = add_saturated(sum[i], static_cast<int16_t>(static_cast<int8_t>(in[i]) * (1 << kSumFractionBits)));
}
inline void add_rgb_row(int16_t* __restrict r, int16_t* __restrict g, int16_t* __restrict b,
                        const uint8_t* __restrict in, int n) {
  for (int i = 0; i < n; i++) {
    r[i] = add_saturated(r[i], static_cast<int16_t>(in[3 * i + 0] << kSumFractionBits));
    g[i] = add_saturated(g[i], static_cast<int16_t>(in[3 * i + 1] << kSumFractionBits));
    b[i] = add_saturated(b[i], static_cast<int16_t>(in[3 * i + 2] << kSumFractionBits));
  }
}
inline void add_lost_row(uint16_t* __restrict lost, const uint8_t* __restrict in, int n) {
  for (int i = 0; i < n; i++) lost[i] = add_saturated(lost[i], widen_lost(in[i]));
}

// 16 bits: sums, and lost weight.
template <typename T>
void add_sum_row(T* __restrict sum, const T* __restrict in, int n) {
  for (int i = 0; i < n; i++) sum[i] = add_saturated(sum[i], in[i]);
}

}  // namespace lf
