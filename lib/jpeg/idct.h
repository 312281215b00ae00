// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>

namespace lf::jpeg {

// The inverse DCT of libjpeg's JDCT_ISLOW, bit by bit: `block` has 64 dequantised coefficients in natural order,
// aligned to 16 bytes; 8 rows of 8 samples, 128 added, go to out, out + stride, ... (any alignment). Thread-safe.
void idct(const int16_t* block, uint8_t* out, ptrdiff_t stride);

// The same where all coefficients but the first, `dc`, are zero.
void idct_dc(int dc, uint8_t* out, ptrdiff_t stride);

}  // namespace lf::jpeg
