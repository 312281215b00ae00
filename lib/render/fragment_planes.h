// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "render/fragment.h"

namespace lf {

// A fragment's pixels in somebody else's memory: a payload as it came off the wire, the output of a JPEG decoder, a
// Fragment. Values as in Fragment.
struct FragmentPlanes {
  PixelFamily family = PixelFamily::kNone;
  Rect rect;                      // of the view; kI420: x0, y0 even
  const uint8_t* plane[3] = {};   // kRgb: plane[0], interleaved RGB; kI420: Y, Cb, Cr without the 128 offset
  ptrdiff_t stride[3] = {};       // bytes from row to row
  const uint8_t* lost = nullptr;  // null where nothing is lost
  ptrdiff_t lost_stride = 0;
};

// Planes one after the other without padding: packed_size(family, rect.width(), rect.height()) bytes at `pixels`.
inline FragmentPlanes packed_planes(PixelFamily family, const Rect& rect, const uint8_t* pixels, const uint8_t* lost) {
  const int w = rect.width(), h = rect.height();
  FragmentPlanes out{.family = family, .rect = rect, .lost = lost, .lost_stride = w};
  out.plane[0] = pixels;
  out.stride[0] = family == PixelFamily::kRgb ? 3 * static_cast<ptrdiff_t>(w) : w;
  if (family != PixelFamily::kI420) return out;
  out.plane[1] = pixels + static_cast<size_t>(w) * h;
  out.plane[2] = out.plane[1] + static_cast<size_t>(chroma_size(w)) * chroma_size(h);
  out.stride[1] = out.stride[2] = chroma_size(w);
  return out;
}

inline FragmentPlanes planes_of(const Fragment& fragment) {
  return packed_planes(fragment.family, fragment.rect, fragment.pixels.data(),
                       fragment.lost.empty() ? nullptr : fragment.lost.data());
}

}  // namespace lf
