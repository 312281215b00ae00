// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>

#include "base/maths.h"
#include "base/memory.h"
#include "image/image.h"

namespace lf {

// A plane of an image and its destination in a copy. Interleaved colours are one plane.
struct PlaneCopy {
  const uint8_t* from;
  uint8_t* to;
  ptrdiff_t stride;   // bytes from row to row, in source and destination
  int step;           // bytes from pixel to pixel
  int width, height;  // pixels of the plane
  Rect part;
  int index;  // 0; 0 to 2 for Y, Cb, Cr in kI420
};

// Returns a copy of `image` in `memory` (resized to fit), with the same size, layout and strides. write(plane) fills
// the part of each plane that `rect` covers; the rest is not written. `rect` must be inside the image, with even x0 and
// y0 for kI420. The result is valid until `memory` changes.
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

// Gains closer to 1 than this are not applied, because they change levels by at most a quarter. Camera gains are 1/2 to
// 2.
inline constexpr float kGainTolerance = 1.f / 512;

// Divides all colours in `rect` by the exposure gain of a camera (its brightness compared with the array), rounded and
// clamped. Arguments and result are as for write_copy(). Padding between pixels is divided, too. All instruction sets
// give the same bits.
ImageView divide_by_gain(const ImageView& image, const Rect& rect, float gain, ByteBuffer& memory);
void divide_by_gain(std::span<uint8_t> luma, float gain);

// Returns the integer factor of divide_by_gain(), which shaders use as well. A value v becomes zero + ((v - zero) 2^7
// gain_factor(gain) / 2^16 + 2^4) / 2^5, rounded down after each division, and clamped. `zero` is 0 for luma and
// colours, and 128 for chroma.
int gain_factor(float gain);

// Sharpening compensates the blur of bilinear sampling. Each sample v of a plane becomes v + kSharpening (v - mean of
// its four neighbours), rounded and clamped. The border of the image is repeated.
inline constexpr double kSharpening = 0.3;
// Shaders use the same integer form: v + (kSharpeningFactor (4 v - sum of neighbours) + 2^7) / 2^8, rounded down and
// clamped.
inline constexpr int kSharpeningBits = 8;
inline constexpr int kSharpeningFactor = static_cast<int>(kSharpening * (1 << kSharpeningBits) / 4 + 0.5);

// Sharpens `rect` of an image. Arguments and result are as for write_copy(). Padding between pixels is sharpened, too.
// All instruction sets give the same bits.
ImageView sharpen(const ImageView& image, const Rect& rect, ByteBuffer& memory);
Image sharpened(const Image& image);

}  // namespace lf
