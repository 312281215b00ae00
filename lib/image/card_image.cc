// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/card_image.h"

#include "image/correction.h"

namespace lf {

ImageView fetched(const ImageView& image, const Rect& part, FetchedMemory& memory) {
  const CardPixels& from = image.on_card;
  if (!from.image) return image;
  ImageView here = from.image->fetch();
  if (here.family == PixelFamily::kNone || part.empty()) return here;
  if (from.gain != 1) {
    // What is sharpened looks at its neighbours.
    const Rect around = from.sharpened ? intersect({part.x0 - 2, part.y0 - 2, part.x1 + 2, part.y1 + 2},
                                                   {0, 0, image.width, image.height})
                                       : part;
    here = divide_by_gain(here, around, from.gain, memory.divided);
  }
  return from.sharpened ? sharpen(here, part, memory.sharpened) : here;
}

}  // namespace lf
