// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "image/image.h"
#include "render/sum_planes.h"

namespace lf {

// The encoding of YCbCr in 8 bits, which is either full range or video range. Luma 0 to 255 becomes gain * luma +
// offset. Chroma -128 to 127 becomes 128 + chroma_gain * chroma.
struct Levels {
  float gain = 1, offset = 0, chroma_gain = 1;
  bool operator==(const Levels&) const = default;
};
inline constexpr Levels kFullLevels;
// BT.601 video range: luma 16 to 235, chroma 16 to 240.
inline constexpr Levels kVideoLevels{219.f / 255, 16, 224.f / 255};

// A colour in full-range BT.601: luma 0 to 255, chroma without the offset of 128.
struct YCbCr {
  float y, cb, cr;
};
inline YCbCr ycbcr_of(float r, float g, float b) {
  return {0.299f * r + 0.587f * g + 0.114f * b, -0.168736f * r - 0.331264f * g + 0.5f * b,
          0.5f * r - 0.418688f * g - 0.081312f * b};
}

// Background colour, RGB 0 to 255.
struct Background {
  uint8_t r = 0, g = 0, b = 0;
  bool operator==(const Background&) const = default;
};

// Converts the sum of all answers to a picture. Each pixel of the sum is divided by the weight that has arrived, which
// is 1 minus the missing weight. For example, if a camera with the weight 0.25 is missing, the remaining cameras have
// contributed 0.75, and the pixel is divided by 0.75.
//
// `sum` must cover the whole view. `uncovered` has one byte per pixel without padding, which is not 0 where the
// background shows; it may be null. The output planes are as in ImageView: kRgb in `layout` (a fourth byte is set to
// 255), or kI420 in `levels`, with interleaved chroma (NV12) if plane[2] == plane[1] + 1.
//
// Values are rounded to the nearest level, halves up. With reduced levels, sums within 1/128 of a half may be rounded
// up or down. A chroma sample uses the mean missing weight of its pixels (up to four), mixed with the background for
// hidden pixels. A pixel with less than 3/255 of its weight shows the background, because sums of 8-bit fragments then
// have no usable colour.
void resolve(const ConstSumPlanes& sum, const uint8_t* uncovered, const Background& background, const RgbLayout& layout,
             uint8_t* const plane[3], const ptrdiff_t stride[3], const Levels& levels = kFullLevels);

// Returns the distance in bytes between neighbouring chroma samples in a row of plane[1] and plane[2]. The distance is
// 2 if Cb and Cr are interleaved (NV12), otherwise 1.
template <typename Byte>
int chroma_step(Byte* const plane[3]) {
  return plane[2] == plane[1] + 1 ? 2 : 1;
}

// Replaces pixels of a picture from resolve() by the previous picture if most of their weight is missing. resolve() can
// only scale up the noisy rest of such pixels or show the background, so the previous picture is closer to the truth. A
// pixel shows the previous picture if at most an eighth of its weight has arrived, the new picture from a quarter on,
// and a mixture in between.
//
// `sum` is the argument of resolve(). `before` has the same family, size and layout as `plane` and `stride`.
void conceal(const ConstSumPlanes& sum, const ImageView& before, uint8_t* const plane[3], const ptrdiff_t stride[3]);

// Row kernels, the building blocks of the functions above and of the summation over cameras.
//
// Each adds a row of `n` values to a row of sums. The additions saturate, so that hostile input cannot wrap around.
// Non-negative sums (luma, RGB and missing weight) do not depend on the order of additions, even if they saturate. Rows
// must not overlap. Results are bit-identical for all instruction sets.

// Input of 8 bits: luma, signed chroma, interleaved RGB into three planes, and missing weight.
void add_row(int16_t* sum, const uint8_t* in, int n);
void add_chroma_row(int16_t* sum, const uint8_t* in, int n);
void add_rgb_row(int16_t* r, int16_t* g, int16_t* b, const uint8_t* in, int n);
void add_missing_row(uint16_t* lost, const uint8_t* in, int n);

// Input of 16 bits: sums, and missing weight.
void add_sum_row(int16_t* sum, const int16_t* in, int n);
void add_sum_row(uint16_t* lost, const uint16_t* in, int n);

// Row kernels that divide sums by the received weight. Rows of `n` values must not overlap. Results are bit-identical
// for all instruction sets.

// Smallest weight of a pixel that still shows its own colour, in units of kMissingOne: 3/255, rounded up. A pixel with
// less weight shows the background.
inline constexpr int kMinWeight = (3 * kMissingOne + 254) / 255;

// Computes the factor `scale` of each pixel from its missing weight `lost`: output level = sum * scale. The factor is 0
// for pixels that show the background.
void make_scales(float* scale, const uint16_t* lost, int n);

// Write sums in `levels` without scaling, for gains below 1. Values are rounded to the nearest level; sums within 1/128
// of a half may be rounded either way.
void write_row(uint8_t* out, const int16_t* sum, const Levels& levels, int n);
void write_chroma_row(uint8_t* out, const int16_t* sum, const Levels& levels, int n);

// Writes sum * scale in `levels`, or `background` where scale is 0. Rounds to the nearest of 0 to 255, halves up. The
// result is exact except for clipping and the rounding of the scale (2^-23 of the value).
void scale_row(uint8_t* out, const int16_t* sum, const float* scale, float background, const Levels& levels, int n);

// First step of converting chroma, which has one sample for up to four pixels: collects the missing weight of these
// pixels. Call this for each row of `w` pixels. The function adds the missing weight (null: none) to each of
// chroma_size(w) samples, and the number of pixels with scale 0.
void add_pairs(int32_t* lost, int32_t* hidden, const uint16_t* missing_of_row, const float* row_scale, int w);
// Second step of converting chroma. Computes the factor of each sample and the share of the background from the totals
// that the first step has collected over `pixels` pixels.
void make_chroma_scales(float* scale, float* share, const int32_t* lost, const int32_t* hidden, float pixels, int n);
// Writes sum * scale * (1 - share) + background * share in `levels`, with sum * scale clipped to -128..127.
void scale_chroma_row(uint8_t* out, const int16_t* sum, const float* scale, const float* share, float background,
                      const Levels& levels, int n);

}  // namespace lf
