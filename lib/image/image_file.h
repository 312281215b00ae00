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

// Functions on the bytes of PNG and JPEG files. The camera source, the renderer and `lf-rig check` all decode stills
// with these functions, so that they agree on what is damaged. They are in jpeg/picture_bytes.cc.
enum class PictureCoding { kOther, kPng, kJpeg };

// By the first bytes.
PictureCoding picture_coding(std::span<const uint8_t> bytes);

// Decodes a whole PNG (always to RGB) or JPEG (to `jpeg_family`). PNG loses its alpha channel, and all but the upper 8
// of 16 bits. Throws Error, without the file's name, if any part is missing or damaged. Thread-safe.
Image decode_picture(std::span<const uint8_t> bytes, PixelFamily jpeg_family);

// The EXIF orientation of a PNG or JPEG, 1..8; 1 (upright) if there is none.
int exif_orientation(std::span<const uint8_t> bytes);
// What a viewer that follows EXIF would do, and that this project does not; empty for orientation 1.
std::string orientation_notice(int orientation);

// Where the JPEG that begins with `bytes` ends: behind its EOI marker, or where another picture begins before that.
// Nothing if it does not end in them. Reads no more than the markers.
std::optional<size_t> jpeg_end(std::span<const uint8_t> bytes);
// Whether a file that begins with `bytes` is a Motion JPEG stream: whole JPEG pictures of one size, one behind another.
// A second picture that belongs to a still, such as a preview or a gain map (MPF), does not count.
bool is_jpeg_stream(std::span<const uint8_t> bytes);

// An RGB image as a JPEG file, quality 1..100. Throws Error.
std::vector<uint8_t> encode_jpeg(const Image& rgb, int quality);

// Grey samples, row by row.
struct GreyPicture {
  int width = 0, height = 0;  // pixels
  std::vector<uint8_t> samples;
};

// The luma of a JPEG file, `smaller` (1, 2, 4 or 8) times as narrow and as low, rounded up: what is left out is not
// decoded. Throws Error.
GreyPicture decode_grey_jpeg(const std::vector<uint8_t>& bytes, int smaller);

}  // namespace lf
