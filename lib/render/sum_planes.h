// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/rect.h"
#include "image/image.h"

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

// Samples along a row of plane c, and its rows.
inline int plane_width(PixelFamily family, const Rect& rect, int c) {
  return c > 0 && family == PixelFamily::kI420 ? chroma_size(rect.width()) : rect.width();
}
inline int plane_height(PixelFamily family, const Rect& rect, int c) {
  return c > 0 && family == PixelFamily::kI420 ? chroma_size(rect.height()) : rect.height();
}

// Planes one after the other without padding, packed_size() samples in all. `lost` may be null.
template <typename Sample, typename Weight>
BasicSumPlanes<Sample, Weight> packed_sums(PixelFamily family, const Rect& rect, Sample* samples, Weight* lost) {
  BasicSumPlanes<Sample, Weight> out{.family = family, .rect = rect, .lost = lost, .lost_stride = rect.width()};
  for (int c = 0; c < 3; c++) {
    out.plane[c] = samples;
    out.stride[c] = plane_width(family, rect, c);
    samples += out.stride[c] * plane_height(family, rect, c);
  }
  return out;
}

// The part of `whole` in `rect`, which lies in its rectangle and begins at even pixels of it in kI420.
template <typename Sample, typename Weight>
BasicSumPlanes<Sample, Weight> part_of(BasicSumPlanes<Sample, Weight> whole, const Rect& rect) {
  const int x = rect.x0 - whole.rect.x0, y = rect.y0 - whole.rect.y0;
  for (int c = 0; c < 3; c++) {
    const int half = c > 0 && whole.family == PixelFamily::kI420 ? 2 : 1;
    whole.plane[c] += y / half * whole.stride[c] + x / half;
  }
  if (whole.lost) whole.lost += y * whole.lost_stride + x;
  whole.rect = rect;
  return whole;
}

}  // namespace lf
