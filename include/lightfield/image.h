// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace lightfield {

// Pixel layout of an image. All formats have 8 bits per channel and keep the gamma of the camera.
enum class PixelFormat : uint8_t {
  kNone = 0,  // the image has no pixels
  kRgb = 1,   // one plane of R, G, B bytes, full range
  kI420 = 2,  // planes Y, Cb, Cr in full-range BT.601; chroma is centred and has half the width and height, rounded up
};

// An image that owns its pixels. Planes follow each other, and rows have no padding.
struct Image {
  PixelFormat format = PixelFormat::kNone;
  int width = 0, height = 0;  // pixels
  std::vector<uint8_t> pixels = {};
};

// Returns a black image. Throws Error if the format is kNone or a side is not within 1 to 16384 pixels.
Image make_image(PixelFormat format, int width, int height);

// Refers to a camera image in the caller's memory, so that frames need not be copied. The pixels must not change during
// the call that uses the view. A default-constructed view represents a camera without an image.
struct ImageView {
  PixelFormat format = PixelFormat::kNone;
  int width = 0, height = 0;     // pixels
  const uint8_t* plane[3] = {};  // kRgb uses plane[0] only
  ptrdiff_t stride[3] = {};      // bytes from the start of a row to the start of the next row

  ImageView() = default;
  // Refers to the pixels of `image`. Throws Error if the number of pixels does not match the size of the image.
  ImageView(const Image& image);  // NOLINT(google-explicit-constructor): implicit on purpose
};

// Refers to a picture in the caller's memory that a function writes. Padding at the end of rows remains unchanged.
struct MutableImageView {
  PixelFormat format = PixelFormat::kNone;
  int width = 0, height = 0;  // pixels
  uint8_t* plane[3] = {};     // kRgb uses plane[0] only
  ptrdiff_t stride[3] = {};   // bytes from the start of a row to the start of the next row

  MutableImageView() = default;
  // Refers to the pixels of `image`. Throws Error if the number of pixels does not match the size of the image.
  MutableImageView(Image& image);  // NOLINT(google-explicit-constructor): implicit on purpose
};

enum class Resampling : uint8_t {
  kBilinear,   // fastest
  kSharpened,  // bilinear on a slightly sharpened image, which restores detail that bilinear sampling loses
};

}  // namespace lightfield
