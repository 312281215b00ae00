// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

// Adding one row of `n` values to a row of sums, saturating, so that hostile input can't wrap. Sums of values that are
// not negative (all luma, RGB and lost weight) come out the same in any order even then. Rows do not overlap. The same
// result with every instruction set.
namespace lf {

// 8 bits: luma; chroma, signed; RGB to three planes; lost weight.
void add_row(int16_t* sum, const uint8_t* in, int n);
void add_chroma_row(int16_t* sum, const uint8_t* in, int n);
void add_rgb_row(int16_t* r, int16_t* g, int16_t* b, const uint8_t* in, int n);
void add_lost_row(uint16_t* lost, const uint8_t* in, int n);

// 16 bits: sums, and lost weight.
void add_sum_row(int16_t* sum, const int16_t* in, int n);
void add_sum_row(uint16_t* lost, const uint16_t* in, int n);

}  // namespace lf
