// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "image/image.h"

namespace lf {

struct ImageSize {
  int width = 0, height = 0;
  bool operator==(const ImageSize&) const = default;
};

// Larger files are not decoded.
inline constexpr int kMaxImageSide = 16384;              // pixels
inline constexpr int64_t kMaxImagePixels = 160'000'000;  // 480 MB as RGB

// Reads the size of an image file from its header: PNG, JPEG, BMP, TIFF, WebP, PNM (PBM, PGM, PPM), PFM or Radiance
// HDR. Decodes no pixel. Throws Error naming the file, also for a size above the limits.
ImageSize load_image_size(const std::string& path);
// Variant of load_image() that throws Error without decoding if the size is not `expected`.
Image load_image_of_size(const std::string& path, ImageSize expected);

// Functions on the bytes of PNG and JPEG files, implemented in jpeg/picture_bytes.cc. The camera source, the renderer
// and `lf-rig check` decode all stills with these functions, so that they agree on damage.
enum class ImageCoding { kOther, kPng, kJpeg };

ImageCoding detect_image_coding(std::span<const uint8_t> bytes);

// Decodes a whole PNG (always to RGB) or JPEG (to `jpeg_family`). Drops the alpha channel and the lower 8 of 16 bits.
// Throws Error, without the file's name, if any part is missing or damaged. Thread-safe.
Image decode_still(std::span<const uint8_t> bytes, PixelFamily jpeg_family);

// Returns the EXIF orientation of a PNG or JPEG, 1..8; 1 (upright) if there is none.
int exif_orientation(std::span<const uint8_t> bytes);
// Returns a message about an EXIF orientation, which this project ignores; empty for orientation 1.
std::string orientation_notice(int orientation);

// Returns the end of the JPEG at the start of `bytes`: behind its EOI marker, or where another picture begins earlier.
// Returns nothing if the end is not in `bytes`. Reads only markers.
std::optional<size_t> jpeg_end(std::span<const uint8_t> bytes);
// True if a file that begins with `bytes` is a Motion JPEG stream: consecutive whole JPEG pictures of one size. A
// second picture that belongs to a still, such as a preview or a gain map (MPF), does not count.
bool is_jpeg_stream(std::span<const uint8_t> bytes);

// Encodes an RGB image as JPEG, quality 1..100. Throws Error.
std::vector<uint8_t> encode_jpeg(const Image& rgb, int quality);

// Grey samples, row by row.
struct GreyImage {
  int width = 0, height = 0;  // pixels
  std::vector<uint8_t> samples;
};

// Decodes the luma of a JPEG at 1 / `smaller` of its size (1, 2, 4 or 8), rounded up, without decoding the rest. Throws
// Error.
GreyImage decode_jpeg_luma(const std::vector<uint8_t>& bytes, int smaller);

}  // namespace lf
