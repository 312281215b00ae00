// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "base/rect.h"
#include "image/image.h"

namespace lf {

// A part of the sum of some cameras' weighted contributions to one view: what an answer has, uncompressed.
//
// `pixels`: kRgb: height rows of width RGB bytes. kI420: Y plane, then Cb and Cr planes of chroma_size(width) x
// chroma_size(height); Cb and Cr are signed bytes (two's complement) without the 128 offset; rect.x0, rect.y0 are even.
// `lost`: the plane of lost weight, 255 = weight 1, width * height bytes; empty where nothing is lost.
struct Fragment {
  PixelFamily family = PixelFamily::kNone;
  Rect rect;
  std::vector<uint8_t> pixels;
  std::vector<uint8_t> lost;

  size_t bytes() const { return pixels.size() + lost.size(); }
  bool operator==(const Fragment&) const = default;
};

}  // namespace lf
