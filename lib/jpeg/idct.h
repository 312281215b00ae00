// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace lf::jpeg {

// The position 8 * row + column of each coefficient of the zigzag order.
inline constexpr std::array<uint8_t, 64> kZigzag = {0,  1,  8,  16, 9,  2,  3,  10, 17, 24, 32, 25, 18, 11, 4,  5,
                                                    12, 19, 26, 33, 40, 48, 41, 34, 27, 20, 13, 6,  7,  14, 21, 28,
                                                    35, 42, 49, 56, 57, 50, 43, 36, 29, 22, 15, 23, 30, 37, 44, 51,
                                                    58, 59, 52, 45, 38, 31, 39, 46, 53, 60, 61, 54, 47, 55, 62, 63};

// Returns the index of a coefficient in the input of idct(). Rows 0 and 2, 1 and 3, 4 and 6, 5 and 7 are interleaved
// element by element, with columns in the order 0 2 1 3 4 6 5 7, because vector instructions multiply and add such
// pairs at once.
constexpr int idct_index(int row, int column) {
  const int pair = row / 4 * 2 + row % 2, lane = column / 4 * 4 + column % 2 * 2 + column / 2 % 2;
  return pair * 16 + lane * 2 + row / 2 % 2;
}
inline constexpr std::array<uint8_t, 64> kIdctOrder = [] {  // idct_index() of each coefficient of the zigzag order
  std::array<uint8_t, 64> place{};
  for (size_t k = 0; k < 64; k++) place[k] = static_cast<uint8_t>(idct_index(kZigzag[k] / 8, kZigzag[k] % 8));
  return place;
}();

// Computes the inverse DCT, bit-identical to libjpeg's JDCT_ISLOW. `block` contains 64 dequantised coefficients in
// kIdctOrder, aligned to 32 bytes. Writes 8 rows of 8 samples, with 128 added, to out, out + stride, and so on; `out`
// needs no alignment. `last` (0 to 63) promises that all later coefficients in zigzag order are zero, which saves time.
// Thread-safe.
void idct(const int16_t* block, unsigned last, uint8_t* out, ptrdiff_t stride);

}  // namespace lf::jpeg
