// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "composite/levels.h"
#include "image/image.h"
#include "render/sum_planes.h"

namespace lf {

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

}  // namespace lf
