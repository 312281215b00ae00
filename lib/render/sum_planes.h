// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "image/image.h"
#include "render/rect.h"

namespace lf {

// A sum of weighted contributions in 16 bits, in somebody else's memory: what a fast renderer writes, what travels as
// raw 16-bit fragments, what a compositor adds up.
//
// A sample is signed, 128 = one of 255 levels: a whole picture's white is 255 * 128 = 32640, so weights that sum to 1
// never overflow, and seven bits of fraction leave rounding to the end. kRgb: three planes R, G, B of the rectangle's
// size. kI420: Y, and Cb, Cr of chroma_size() without the 128 offset; rect.x0, rect.y0 even.
// `lost`: the sum of lost weight, 32768 = weight 1; null where nothing is lost.
inline constexpr int kSumFractionBits = 7;
inline constexpr int kLostOne = 32768;

template <typename Sample, typename Weight>
struct BasicSumPlanes {
  PixelFamily family = PixelFamily::kNone;
  Rect rect;  // of the view
  Sample* plane[3] = {};
  ptrdiff_t stride[3] = {};  // samples from row to row
  Weight* lost = nullptr;
  ptrdiff_t lost_stride = 0;
};
using SumPlanes = BasicSumPlanes<int16_t, uint16_t>;
using ConstSumPlanes = BasicSumPlanes<const int16_t, const uint16_t>;

}  // namespace lf
