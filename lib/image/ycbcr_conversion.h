// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "image/image.h"

namespace lf {

// How 8-bit YCbCr video stands for colours (ITU-R BT.601-7, BT.709-6, BT.2020-2): Y = kr R + (1 - kr - kb) G + kb B.
struct YcbcrKind {
  double kr = 0.299, kb = 0.114;
  bool full_range = true;      // 0 to 255; else luma from 16 to 235, chroma from 16 to 240
  double right = 0, down = 0;  // pixels that chroma samples are from the middle of their 2 x 2 pixels: 0 or -0.5
};

// Makes PixelFamily::kI420 of planar video with chroma at half the resolution of another kind. Each value is that of
// exact arithmetic to 1 of 255, the mean error of a flat picture at most half of that: where the matrix is another one
// chroma stands for all of its 2 x 2 pixels, and between samples it is linear. Immutable.
class YcbcrConversion {
 public:
  explicit YcbcrConversion(const YcbcrKind& from);

  // `in`: three planes of the kind, `out` of the same size, its rows `stride` bytes apart, and not the same memory.
  void convert(const ImageView& in, uint8_t* const out[3], const ptrdiff_t stride[3]) const;

 private:
  void sited_row(const ImageView& in, int plane, int y, int32_t* out) const;

  const YcbcrKind from_;
  std::array<int32_t, 256> luma_;  // 2^16ths of output levels
  int32_t luma_of_[2];             // for each sixteenth of a level of chroma away from the middle, 2^16ths: of Cb, Cr
  int32_t chroma_of_[2][2];        // the same of output Cb and Cr
};

}  // namespace lf
