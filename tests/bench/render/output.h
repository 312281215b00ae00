// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "composite/accumulator.h"
#include "image/image.h"

namespace lf::bench {

// The finished picture in memory that is kept from view to view, as elements and OpenCV have it: fresh memory costs
// more than filling it.
inline void resolve_into(const Accumulator& sum, Image& picture) {
  if (picture.family() != sum.family() || picture.width() != sum.width() || picture.height() != sum.height())
    picture = Image(sum.family(), sum.width(), sum.height());
  const ImageView view = picture.view();
  uint8_t* plane[3] = {picture.plane(0), nullptr, nullptr};
  if (sum.family() == PixelFamily::kI420)
    for (int i = 1; i < 3; i++) plane[i] = picture.plane(i);
  sum.resolve({}, RgbLayout{}, plane, view.stride);
}

}  // namespace lf::bench
