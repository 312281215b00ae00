// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>

#include "base/maths.h"
#include "base/memory.h"
#include "image/image.h"

namespace lf {

// A plane of an image, and where it goes in a copy. Interleaved colours are one plane.
struct PlaneCopy {
  const uint8_t* from;
  uint8_t* to;
  ptrdiff_t stride;   // bytes from row to row, in the image and in the copy
  int step;           // bytes from pixel to pixel
  int width, height;  // pixels of the plane
  Rect part;          // part of the plane that is asked for
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

// Gains of cameras: 1/2 to 2. Less far from 1 than this they are not worth a pass over an image: a quarter of a level.
inline constexpr float kLeastGain = 1.f / 512;

// Takes a camera's gain out: every colour divided by it, rounded and clamped. The image with its part in `rect` (inside
// it; x0, y0 even in kI420) divided, in `memory`, of which the rest is left as it is: of the same size and layout, what
// is between the colours of a pixel divided, too. Valid as long as `memory` is left alone. The same result with every
// instruction set.
ImageView divide_by_gain(const ImageView& image, const Rect& rect, float gain, ByteBuffer& memory);
// Divides luma alone, in place.
void divide_by_gain(std::span<uint8_t> luma, float gain);

// The same in integers, as shaders do it: a value v, of luma or a colour (`zero` 0) or of chroma (128), becomes
// zero + ((v - zero) 2^7 gain_factor(gain) / 2^16 + 2^4) / 2^5, all rounded down, and clamped.
int gain_factor(float gain);

// Makes up for what bilinear sampling takes away: v + kSharpening (v - mean of its four neighbours), rounded and
// clamped, of every sample of each plane, neighbours repeated at the image's border: bilinear samples of the result
// bring two thirds of what Catmull-Rom's would, at a fraction of the cost.
inline constexpr double kSharpening = 0.3;
// In integers, as shaders do it: v + (kSharpeningFactor (4 v - the four) + 2^7) / 2^8, rounded down, and clamped.
inline constexpr int kSharpeningBits = 8;
inline constexpr int kSharpeningFactor = static_cast<int>(kSharpening * (1 << kSharpeningBits) / 4 + 0.5);

// The image with the part in `rect` (inside the image; x0, y0 even in kI420) sharpened, in `memory`, of which the rest
// is left as it is: of the same size and layout, what is between the colours of a pixel sharpened, too. Valid as long
// as `memory` is left alone. The same result with every instruction set.
ImageView sharpen(const ImageView& image, const Rect& rect, ByteBuffer& memory);
// The whole image, sharpened.
Image sharpened(const Image& image);

}  // namespace lf
