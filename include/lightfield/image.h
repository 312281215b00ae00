// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace lightfield {

// Pixel layout. Colours have 8 bits per channel and keep the gamma of the camera.
enum class PixelFormat : uint8_t {
  kNone = 0,  // no pixels
  kRgb = 1,   // one plane of R, G, B bytes, full range
  kI420 = 2,  // planes Y, Cb, Cr: BT.601, full range; chroma is centred, half the width and height rounded up
};

// An image that owns its pixels: consecutive planes, rows without padding.
struct Image {
  PixelFormat format = PixelFormat::kNone;
  int width = 0, height = 0;  // pixels
  std::vector<uint8_t> pixels = {};
};

// Returns a black image. Throws Error if the format is kNone or a side is outside of 1 to 16384 pixels.
Image make_image(PixelFormat format, int width, int height);

// A camera image in the caller's memory. The pixels must not change during the call that uses the view. A
// default-constructed view means that the camera has no image.
struct ImageView {
  PixelFormat format = PixelFormat::kNone;
  int width = 0, height = 0;     // pixels
  const uint8_t* plane[3] = {};  // kRgb: plane[0] only
  ptrdiff_t stride[3] = {};      // bytes from one row to the next; at least the bytes of a row

  ImageView() = default;
  // Refers to the pixels of `image`. Throws Error if their number does not match the size of the image.
  ImageView(const Image& image);  // NOLINT(google-explicit-constructor): implicit on purpose
};

enum class Resampling : uint8_t {
  kBilinear,   // fastest
  kSharpened,  // bilinear on a sharpened image, which compensates the blur of bilinear sampling
};

}  // namespace lightfield
