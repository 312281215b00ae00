// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "composite/levels.h"
#include "render/sum_planes.h"

namespace lf {

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
