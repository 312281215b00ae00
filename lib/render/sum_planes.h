// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/maths.h"
#include "image/image.h"

namespace lf {

// A part of the sum of some cameras' weighted contributions to one view: what an answer has, uncompressed.
//
// `pixels`: kRgb: height rows of width RGB bytes. kI420: Y plane, then Cb and Cr planes of chroma_size(width) x
// chroma_size(height); Cb and Cr are signed bytes (two's complement) without the 128 offset; rect.x0, rect.y0 are even.
// `lost`: the plane of lost weight, 255 = weight 1, width * height bytes; empty where nothing is lost.
struct Fragment {
  PixelFamily family = PixelFamily::kNone;
  Rect rect;
  std::vector<uint8_t> pixels;
  std::vector<uint8_t> lost;

  size_t bytes() const { return pixels.size() + lost.size(); }
  bool operator==(const Fragment&) const = default;
};

// A fragment's pixels in somebody else's memory: a payload as it came off the wire, the output of a JPEG decoder, a
// Fragment. Values as in Fragment.
struct FragmentPlanes {
  PixelFamily family = PixelFamily::kNone;
  Rect rect;                      // part of the view; kI420: x0, y0 even
  const uint8_t* plane[3] = {};   // kRgb: plane[0], interleaved RGB; kI420: Y, Cb, Cr without the 128 offset
  ptrdiff_t stride[3] = {};       // bytes from row to row
  const uint8_t* lost = nullptr;  // null where nothing is lost
  ptrdiff_t lost_stride = 0;
};

// The planes of a fragment that lie one after the other without padding: packed_size(family, rect.width(),
// rect.height()) bytes at `pixels`.
inline FragmentPlanes packed_planes(PixelFamily family, const Rect& rect, const uint8_t* pixels, const uint8_t* lost) {
  const int w = rect.width(), h = rect.height();
  FragmentPlanes out{.family = family, .rect = rect, .lost = lost, .lost_stride = w};
  out.plane[0] = pixels;
  out.stride[0] = family == PixelFamily::kRgb ? 3 * static_cast<ptrdiff_t>(w) : w;
  if (family != PixelFamily::kI420) return out;
  out.plane[1] = pixels + static_cast<size_t>(w) * h;
  out.plane[2] = out.plane[1] + static_cast<size_t>(chroma_size(w)) * chroma_size(h);
  out.stride[1] = out.stride[2] = chroma_size(w);
  return out;
}

inline FragmentPlanes planes_of(const Fragment& fragment) {
  return packed_planes(fragment.family, fragment.rect, fragment.pixels.data(),
                       fragment.lost.empty() ? nullptr : fragment.lost.data());
}

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
  Rect rect;  // part of the view
  Sample* plane[3] = {};
  ptrdiff_t stride[3] = {};  // samples from row to row
  Weight* lost = nullptr;
  ptrdiff_t lost_stride = 0;
};
using SumPlanes = BasicSumPlanes<int16_t, uint16_t>;
using ConstSumPlanes = BasicSumPlanes<const int16_t, const uint16_t>;

// Samples along a row of plane c, and how many rows it has.
inline int plane_width(PixelFamily family, const Rect& rect, int c) {
  return c > 0 && family == PixelFamily::kI420 ? chroma_size(rect.width()) : rect.width();
}
inline int plane_height(PixelFamily family, const Rect& rect, int c) {
  return c > 0 && family == PixelFamily::kI420 ? chroma_size(rect.height()) : rect.height();
}

// The planes of a sum that lie one after the other without padding, packed_size() samples in all. `lost` may be null.
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

// These round sums in 16 bits to 8, to the nearest level, halves up, saturated. Rows of `n` values do not overlap;
// results are the same with every instruction set.

// Rounds lost weight in units of 1 / kLostOne to units of 1 / 255.
inline uint8_t round_lost(uint16_t lost) {
  return static_cast<uint8_t>((std::min<int>(lost, kLostOne) * 255 + kLostOne / 2) / kLostOne);
}

void round_row(uint8_t* out, const int16_t* sum, int n);
// `offset` 128: as in pictures, 0: as in fragments.
void round_chroma_row(uint8_t* out, const int16_t* sum, int n, uint8_t offset);
// Rounds three rows to one of pixels, whose fourth byte, where there is one, is set to 255.
void round_rgb_row(uint8_t* out, const RgbLayout& layout, const int16_t* r, const int16_t* g, const int16_t* b, int n);

// The sums as a fragment in 8 bits, without a plane of lost weight where all of it rounds to 0.
Fragment rounded_fragment(const ConstSumPlanes& sums);

}  // namespace lf
