// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "image/image.h"
#include "render/sum_planes.h"

namespace lf {

// How 8 bits hold YCbCr: luma of 0..255 as gain * luma + offset, chroma of -128..127 as 128 + chroma_gain * chroma.
struct Levels {
  float gain = 1, offset = 0, chroma_gain = 1;
  bool operator==(const Levels&) const = default;
};
inline constexpr Levels kFullLevels;
// BT.601 as video has it: luma from 16 to 235, chroma from 16 to 240.
inline constexpr Levels kVideoLevels{219.f / 255, 16, 224.f / 255};

// BT.601, full range: 0..255, and chroma without the 128 offset.
struct YCbCr {
  float y, cb, cr;
};
// `r`, `g`, `b`: 0..255.
inline YCbCr ycbcr_of(float r, float g, float b) {
  return {0.299f * r + 0.587f * g + 0.114f * b, -0.168736f * r - 0.331264f * g + 0.5f * b,
          0.5f * r - 0.418688f * g - 0.081312f * b};
}

// Opaque colour shown where nothing contributes, RGB 0..255.
struct Background {
  uint8_t r = 0, g = 0, b = 0;
  bool operator==(const Background&) const = default;
};

// Makes the picture of the sum of everything, divided by 1 - (sum of lost weight) where weight was lost.
//
// `sum`: of the whole view (rect.x0 = rect.y0 = 0). `uncovered`: a byte per pixel without padding, not 0 where the
// background shows too; null: nowhere. The picture goes into packed planes as in ImageView: kRgb in `layout` (a fourth
// byte is set to 255: opaque), or kI420 as `levels` has it, whose chroma is interleaved (NV12) where plane[2] is
// plane[1] + 1. Rounded to the nearest level, halves up (with less than full levels: but for sums within 1/128 of a
// half). Chroma loses the mean of the lost weight of its up to four pixels; the background takes the share of those of
// them that show it. A pixel with less than 3/255 of its weight left shows the background: sums of 8-bit fragments
// leave it no colour.
void resolve(const ConstSumPlanes& sum, const uint8_t* uncovered, const Background& background, const RgbLayout& layout,
             uint8_t* const plane[3], const ptrdiff_t stride[3], const Levels& levels = kFullLevels);

// Bytes from one chroma sample to the next along a row of plane[1] and plane[2]: 2 where Cb and Cr are interleaved.
template <typename Byte>
int chroma_step(Byte* const plane[3]) {
  return plane[2] == plane[1] + 1 ? 2 : 1;
}

// Mends a picture that resolve() has made where most of a pixel's weight was lost: what little is left has been scaled
// up with all its noise, and with nothing left the background shows. The view's picture before this one is nearer to
// the truth there: with an eighth of the weight or less left a pixel is that one's, with a quarter or more it stays as
// it is, between them it is a mixture.
//
// `sum`: as resolve() took it. `before`: of the same family, size and layout as the picture in `plane`, `stride`.
void conceal(const ConstSumPlanes& sum, const ImageView& before, uint8_t* const plane[3], const ptrdiff_t stride[3]);

// Rows, of which all of the above is made, and sums of cameras.
//
// These add one row of `n` values to a row of sums, saturating, so that hostile input can't wrap. Sums of values that
// are not negative (all luma, RGB and lost weight) come out the same in any order even then. Rows do not overlap. The
// same result with every instruction set.

// 8 bits: luma; chroma, signed; RGB to three planes; lost weight.
void add_row(int16_t* sum, const uint8_t* in, int n);
void add_chroma_row(int16_t* sum, const uint8_t* in, int n);
void add_rgb_row(int16_t* r, int16_t* g, int16_t* b, const uint8_t* in, int n);
void add_lost_row(uint16_t* lost, const uint8_t* in, int n);

// 16 bits: sums, and lost weight.
void add_sum_row(int16_t* sum, const int16_t* in, int n);
void add_sum_row(uint16_t* lost, const uint16_t* in, int n);

// Dividing sums by what is left of a pixel's weight. Rows of `n` values do not overlap; the same result with every
// instruction set.

// With less valid weight than this (of kLostOne) a pixel shows the background: 3/255, rounded up.
inline constexpr int kLeastWeight = (3 * kLostOne + 254) / 255;

// What a pixel becomes is sum * scale, in levels; 0 where too much was lost.
void make_scales(float* scale, const uint16_t* lost, int n);

// Sums that need no scaling, as `levels` has it, whose gains are less than 1: to the nearest level, but for sums within
// 1/128 of the middle between two.
void write_row(uint8_t* out, const int16_t* sum, const Levels& levels, int n);
void write_chroma_row(uint8_t* out, const int16_t* sum, const Levels& levels, int n);

// sum * scale, or `background` where scale is 0, as `levels` has it, to the nearest of 0..255, halves up: exact in
// float wherever the result is not cut off, up to the rounding of the scale itself (2^-23 of the value).
void scale_row(uint8_t* out, const int16_t* sum, const float* scale, float background, const Levels& levels, int n);

// The first step for chroma, which has one sample for up to four pixels, for each row of `w` pixels: adds up, for each
// of chroma_size(w) samples, the lost weight (none if null) and the pixels whose scale is 0.
void add_pairs(int32_t* lost, int32_t* hidden, const uint16_t* row_lost, const float* row_scale, int w);
// Makes each chroma sample's factor, and the share of the background in it, of what add_pairs() has added up over
// `pixels` pixels.
void make_chroma_scales(float* scale, float* share, const int32_t* lost, const int32_t* hidden, float pixels, int n);
// sum * scale * (1 - share) + background * share, as `levels` has it; sum * scale is cut off at -128 and 127.
void scale_chroma_row(uint8_t* out, const int16_t* sum, const float* scale, const float* share, float background,
                      const Levels& levels, int n);

}  // namespace lf
