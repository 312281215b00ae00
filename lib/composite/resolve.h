// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "image/image.h"
#include "render/sum_planes.h"

namespace lf {

// Encodes YCbCr in 8 bits: luma 0..255 as gain * luma + offset, chroma -128..127 as 128 + chroma_gain * chroma.
struct Levels {
  float gain = 1, offset = 0, chroma_gain = 1;
  bool operator==(const Levels&) const = default;
};
inline constexpr Levels kFullLevels;
// BT.601 video range: luma 16 to 235, chroma 16 to 240.
inline constexpr Levels kVideoLevels{219.f / 255, 16, 224.f / 255};

// BT.601, full range: luma 0..255, chroma without the offset of 128.
struct YCbCr {
  float y, cb, cr;
};
inline YCbCr ycbcr_of(float r, float g, float b) {
  return {0.299f * r + 0.587f * g + 0.114f * b, -0.168736f * r - 0.331264f * g + 0.5f * b,
          0.5f * r - 0.418688f * g - 0.081312f * b};
}

// Opaque background colour, RGB 0..255.
struct Background {
  uint8_t r = 0, g = 0, b = 0;
  bool operator==(const Background&) const = default;
};

// Converts a complete sum to a picture: divides by 1 - (sum of missing weight).
//
// `sum`: covers the whole view (rect.x0 = rect.y0 = 0). `uncovered`: one byte per pixel without padding, not 0 where
// the background shows; may be null. The output planes are as in ImageView: kRgb in `layout` (a fourth byte is set to
// 255, opaque), or kI420 in `levels`, with interleaved chroma (NV12) if plane[2] == plane[1] + 1.
//
// Values are rounded to the nearest level, halves up; with reduced levels, sums within 1/128 of a half may go either
// way. A chroma sample uses the mean missing weight of its pixels (up to four) and mixes in the background for hidden
// pixels. A pixel with less than 3/255 of its weight shows the background, because sums of 8-bit fragments then have no
// usable colour.
void resolve(const ConstSumPlanes& sum, const uint8_t* uncovered, const Background& background, const RgbLayout& layout,
             uint8_t* const plane[3], const ptrdiff_t stride[3], const Levels& levels = kFullLevels);

// Bytes between chroma samples in a row of plane[1] and plane[2]; 2 if Cb and Cr are interleaved.
template <typename Byte>
int chroma_step(Byte* const plane[3]) {
  return plane[2] == plane[1] + 1 ? 2 : 1;
}

// Fixes up a picture of resolve() where most of a pixel's weight is missing. There, the remaining weight is scaled up
// with its noise, or the background shows; the previous picture is closer to the truth. A pixel shows the previous
// picture if at most an eighth of its weight is left, the new picture if a quarter or more is left, and a mixture in
// between.
//
// `sum`: the argument of resolve(). `before`: same family, size and layout as `plane`, `stride`.
void conceal(const ConstSumPlanes& sum, const ImageView& before, uint8_t* const plane[3], const ptrdiff_t stride[3]);

// Row kernels: the building blocks of the functions above and of summation over cameras.
//
// Each adds one row of `n` values to a row of sums, saturating, so that hostile input cannot wrap. Non-negative sums
// (luma, RGB and missing weight) do not depend on the order of additions, even when saturated. Rows must not overlap.
// Results are bit-identical for all instruction sets.

// 8-bit input: luma; signed chroma; interleaved RGB into three planes; missing weight.
void add_row(int16_t* sum, const uint8_t* in, int n);
void add_chroma_row(int16_t* sum, const uint8_t* in, int n);
void add_rgb_row(int16_t* r, int16_t* g, int16_t* b, const uint8_t* in, int n);
void add_missing_row(uint16_t* lost, const uint8_t* in, int n);

// 16-bit input: sums; missing weight.
void add_sum_row(int16_t* sum, const int16_t* in, int n);
void add_sum_row(uint16_t* lost, const uint16_t* in, int n);

// Row kernels that divide sums by the remaining weight. Rows of `n` values must not overlap. Results are bit-identical
// for all instruction sets.

// Smallest valid weight (of kMissingOne) before a pixel shows the background: 3/255, rounded up.
inline constexpr int kLeastWeight = (3 * kMissingOne + 254) / 255;

// Computes the factors: output level = sum * scale; 0 for pixels that show the background.
void make_scales(float* scale, const uint16_t* lost, int n);

// Writes unscaled sums in `levels` with gains below 1: nearest level, except for sums within 1/128 of a half.
void write_row(uint8_t* out, const int16_t* sum, const Levels& levels, int n);
void write_chroma_row(uint8_t* out, const int16_t* sum, const Levels& levels, int n);

// Writes sum * scale in `levels`, or `background` where scale is 0. Rounds to the nearest of 0..255, halves up. Exact
// in float except for clipping and the rounding of the scale (2^-23 of the value).
void scale_row(uint8_t* out, const int16_t* sum, const float* scale, float background, const Levels& levels, int n);

// First step for chroma, which has one sample for up to four pixels. Call for each row of `w` pixels. Adds to each of
// chroma_size(w) samples the missing weight (null: none) and the number of pixels with scale 0.
void add_pairs(int32_t* lost, int32_t* hidden, const uint16_t* missing_of_row, const float* row_scale, int w);
// Second step for chroma: computes each sample's factor and its share of the background from the totals over `pixels`
// pixels.
void make_chroma_scales(float* scale, float* share, const int32_t* lost, const int32_t* hidden, float pixels, int n);
// Writes sum * scale * (1 - share) + background * share in `levels`; sum * scale is clipped to -128..127.
void scale_chroma_row(uint8_t* out, const int16_t* sum, const float* scale, const float* share, float background,
                      const Levels& levels, int n);

}  // namespace lf
