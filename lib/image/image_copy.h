// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "base/byte_buffer.h"
#include "base/rect.h"
#include "image/image.h"

namespace lf {

// A plane of an image, and where it goes in a copy. Interleaved colours are one plane.
struct PlaneCopy {
  const uint8_t* from;
  uint8_t* to;
  ptrdiff_t stride;   // bytes from row to row, of both
  int step;           // bytes from pixel to pixel
  int width, height;  // pixels of the plane
  Rect part;          // of it, that is asked for
  int index;          // 0; kI420: Y, Cb, Cr
};

// A copy of `image` with the same size, layout and strides in `memory`, which is made to fit: write(plane) fills the
// part of each plane that `rect` covers (inside the image; x0, y0 even in kI420). What nobody writes is left as it is.
// Valid as long as `memory` is left alone.
template <typename Write>
ImageView write_copy(const ImageView& image, const Rect& rect, ByteBuffer& memory, const Write& write) {
  const bool rgb = image.family == PixelFamily::kRgb;
  const int planes = rgb ? 1 : 3;
  const Rect half{rect.x0 / 2, rect.y0 / 2, chroma_size(rect.x1), chroma_size(rect.y1)};
  const auto rows = [&](int c) { return c == 0 ? image.height : chroma_size(image.height); };
  size_t size = 0;
  for (int c = 0; c < planes; c++) size += static_cast<size_t>(rows(c)) * image.stride[c];
  memory.resize(size);
  ImageView out = image;
  uint8_t* to = memory.data();
  for (int c = 0; c < planes; c++) {
    out.plane[c] = to;
    write(PlaneCopy{image.plane[c], to, image.stride[c], rgb ? image.layout.pixel_stride : 1,
                    c == 0 ? image.width : chroma_size(image.width), rows(c), c == 0 ? rect : half, c});
    to += rows(c) * image.stride[c];
  }
  return out;
}

}  // namespace lf
