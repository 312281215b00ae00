// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "base/byte_buffer.h"
#include "base/rect.h"
#include "image/image.h"

namespace lf {

// Luma of an image, low-passed by a box of kTrialBox x kTrialBox pixels: what trials sample, so that a quarter of the
// view's resolution is enough. At full resolution: sampling an image of a quarter of the size costs 1 dB.
inline constexpr int kTrialBox = 4;  // pixels
// Value (x, y) is the mean of luma at x - 1 .. x + 2 and y - 1 .. y + 2, as far as the image goes: it belongs to
// (x + 1/2, y + 1/2).
struct BoxedLuma {
  static constexpr size_t kSpare = 1;  // values behind the others that may be read, too
  Rect rect;                           // of the image
  // Row-major, and kSpare of no meaning. The lower byte is the value, the upper one that of the row below (of no
  // meaning in the image's last row): four neighbours are in two values, so that one load has them.
  UninitializedVector<uint16_t> values;
};
// `rect`: what is needed, inside the image. The same result with every instruction set.
void box_luma(const ImageView& image, const Rect& rect, BoxedLuma& out);

}  // namespace lf
