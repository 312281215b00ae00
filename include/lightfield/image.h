// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace lightfield {

// How pixels are laid out. Colours have 8 bits and the gamma that cameras give them.
enum class PixelFormat : uint8_t {
  kNone = 0,  // no pixels
  kRgb = 1,   // one plane of R, G, B bytes, full range
  kI420 = 2,  // planes Y, Cb, Cr: BT.601, full range; chroma has half the width and height, rounded up, and is centred
};

// A picture that owns its pixels: the planes one after the other, rows without padding.
struct Image {
  PixelFormat format = PixelFormat::kNone;
  int width = 0, height = 0;  // pixels
  std::vector<uint8_t> pixels = {};
};

// A black RGB image, or a black I420 one. Throws Error for a size below 1 or above 16384 pixels a side.
Image make_image(PixelFormat format, int width, int height);

// A camera's image in memory of the caller, who keeps it unchanged for as long as the call lasts that it is given to.
// The default is no image: the camera has no picture this time.
struct ImageView {
  PixelFormat format = PixelFormat::kNone;
  int width = 0, height = 0;     // pixels
  const uint8_t* plane[3] = {};  // kRgb: plane[0] alone
  ptrdiff_t stride[3] = {};      // bytes from a row to the next one, at least a row's own

  ImageView() = default;
  // Refers to the image's pixels. Throws Error if these are not as many as its size asks for.
  ImageView(const Image& image);  // NOLINT(google-explicit-constructor): an image is viewed without a word
};

// How positions between a camera's pixels are sampled.
enum class Resampling : uint8_t {
  kBilinear,   // the fastest
  kSharpened,  // bilinear, of images that are sharpened first, which makes up for what bilinear samples lose
};

}  // namespace lightfield
