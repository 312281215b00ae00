// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/maths.h"
#include "image/image.h"

namespace lf {

// A rectangle of a view with the weighted sum of some cameras, rounded to 8 bits. An uncompressed answer consists of
// such fragments.
//
// `pixels` depends on the family. kRgb has height rows of width RGB bytes. kI420 has a Y plane, then Cb and Cr planes
// of chroma_size(width) x chroma_size(height). Cb and Cr are signed bytes (two's complement) without the 128 offset,
// and rect.x0 and rect.y0 are even. `lost` is a plane of missing weight with width * height bytes, and 255 means weight
// 1. It is empty if no weight is missing.
struct Fragment {
  PixelFamily family = PixelFamily::kNone;
  Rect rect;
  std::vector<uint8_t> pixels;
  std::vector<uint8_t> lost;

  size_t bytes() const { return pixels.size() + lost.size(); }
  bool operator==(const Fragment&) const = default;
};

// A non-owning view of a fragment's pixels, for example of a received payload, a decoder's output or a Fragment. The
// values are as in Fragment.
struct FragmentPlanes {
  PixelFamily family = PixelFamily::kNone;
  Rect rect;                      // part of the view; x0 and y0 are even in kI420
  const uint8_t* plane[3] = {};   // kRgb: plane[0], interleaved RGB; kI420: Y, Cb, Cr without the 128 offset
  ptrdiff_t stride[3] = {};       // bytes from row to row
  const uint8_t* lost = nullptr;  // null if no weight is missing
  ptrdiff_t missing_stride = 0;
};

// Returns the planes of a packed fragment, which has packed_size(family, rect.width(), rect.height()) bytes at
// `pixels`.
inline FragmentPlanes packed_planes(PixelFamily family, const Rect& rect, const uint8_t* pixels, const uint8_t* lost) {
  const int w = rect.width(), h = rect.height();
  FragmentPlanes out{.family = family, .rect = rect, .lost = lost, .missing_stride = w};
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

// A non-owning view of a weighted sum in 16 bits, for renderers, raw 16-bit fragments and compositors.
//
// Samples are signed, and 128 units are one of 255 levels. White is 255 * 128 = 32640, so weights that add up to 1
// never overflow. The seven fractional bits allow rounding once, at the end. kRgb has three planes R, G, B of the
// rectangle's size. kI420 has Y, Cb and Cr with chroma_size() and without the 128 offset, and rect.x0 and rect.y0 are
// even. `lost` is the sum of the missing weight, and 32768 means weight 1. It is null if no weight is missing.
inline constexpr int kSumFractionBits = 7;
inline constexpr int kMissingOne = 32768;

template <typename Sample, typename Weight>
struct BasicSumPlanes {
  PixelFamily family = PixelFamily::kNone;
  Rect rect;
  Sample* plane[3] = {};
  ptrdiff_t stride[3] = {};  // distance between rows, samples
  Weight* lost = nullptr;
  ptrdiff_t missing_stride = 0;
};
using SumPlanes = BasicSumPlanes<int16_t, uint16_t>;
using ConstSumPlanes = BasicSumPlanes<const int16_t, const uint16_t>;

// These functions return the size of plane c in samples.
inline int plane_width(PixelFamily family, const Rect& rect, int c) {
  return c > 0 && family == PixelFamily::kI420 ? chroma_size(rect.width()) : rect.width();
}
inline int plane_height(PixelFamily family, const Rect& rect, int c) {
  return c > 0 && family == PixelFamily::kI420 ? chroma_size(rect.height()) : rect.height();
}

// Returns the planes of a packed sum, which has packed_size() samples. `lost` may be null.
template <typename Sample, typename Weight>
BasicSumPlanes<Sample, Weight> packed_sums(PixelFamily family, const Rect& rect, Sample* samples, Weight* lost) {
  BasicSumPlanes<Sample, Weight> out{.family = family, .rect = rect, .lost = lost, .missing_stride = rect.width()};
  for (int c = 0; c < 3; c++) {
    out.plane[c] = samples;
    out.stride[c] = plane_width(family, rect, c);
    samples += out.stride[c] * plane_height(family, rect, c);
  }
  return out;
}

// Returns the part of `whole` in `rect`. `rect` must be inside the rectangle of `whole` and, in kI420, start at even
// offsets.
template <typename Sample, typename Weight>
BasicSumPlanes<Sample, Weight> part_of(BasicSumPlanes<Sample, Weight> whole, const Rect& rect) {
  const int x = rect.x0 - whole.rect.x0, y = rect.y0 - whole.rect.y0;
  for (int c = 0; c < 3; c++) {
    const int half = c > 0 && whole.family == PixelFamily::kI420 ? 2 : 1;
    whole.plane[c] += y / half * whole.stride[c] + x / half;
  }
  if (whole.lost) whole.lost += y * whole.missing_stride + x;
  whole.rect = rect;
  return whole;
}

// The functions below round 16-bit sums to the nearest 8-bit level, with halves up and saturation. Input and output
// rows of `n` values must not overlap. All instruction sets give the same results.

// Converts missing weight from units of 1 / kMissingOne to units of 1 / 255.
inline uint8_t round_missing(uint16_t lost) {
  return static_cast<uint8_t>((std::min<int>(lost, kMissingOne) * 255 + kMissingOne / 2) / kMissingOne);
}

void round_row(uint8_t* out, const int16_t* sum, int n);
// Rounds a row of chroma sums. `offset` is 128 for pictures and 0 for fragments, which store signed chroma.
void round_chroma_row(uint8_t* out, const int16_t* sum, int n, uint8_t offset);
// Interleaves three rows into pixels. A fourth byte per pixel becomes 255.
void round_rgb_row(uint8_t* out, const RgbLayout& layout, const int16_t* r, const int16_t* g, const int16_t* b, int n);

// Rounds a sum to 8 bits, as the fragment of an answer. Leaves out the plane of missing weight if all its values round
// to 0.
Fragment rounded_fragment(const ConstSumPlanes& sums);

}  // namespace lf
