// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <string>

#include "image/image.h"

namespace lf {

// Width and height of a picture in pixels.
struct ImageSize {
  int width = 0, height = 0;
  bool operator==(const ImageSize&) const = default;
};

// What a file may claim. Its pixels are not decoded if it claims more.
inline constexpr int kMostImageSide = 16384;              // pixels
inline constexpr int64_t kMostImagePixels = 160'000'000;  // 480 MB as RGB

// Reads the size of an image file from its header: PNG, JPEG, BMP, TIFF, WebP, PNM (PBM, PGM, PPM), PFM or Radiance
// HDR. Decodes no pixel. Throws Error naming the file, also for a size above the limits.
ImageSize load_image_size(const std::string& path);
// Reads an image as load_image() does, but throws Error without decoding it if it is not of this size.
Image load_image_of_size(const std::string& path, ImageSize expected);

}  // namespace lf
