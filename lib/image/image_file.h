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

// Reads the size of an image file from its header, without decoding pixels. Supports PNG, JPEG, TIFF, WebP, PGM and
// PPM (binary), and BMP (uncompressed, 8, 24 or 32 bits per pixel). Throws Error with the file's name, also for a size
// above the limits.
ImageSize load_image_size(const std::string& path);
// Reads an image that must have the size `expected`, like load_image(). If the size differs, throws Error without
// decoding the image.
Image load_image_of_size(const std::string& path, ImageSize expected);

// The functions below work on the bytes of PNG and JPEG files; they are implemented in jpeg/picture_bytes.cc.
enum class ImageCoding { kOther, kPng, kJpeg };

ImageCoding detect_image_coding(std::span<const uint8_t> bytes);

// Decodes a whole PNG (always to RGB) or JPEG (to `jpeg_family`). Drops the alpha channel and the lower 8 of 16 bits.
// Throws Error, without the file's name, if any part is missing or damaged. Thread-safe.
Image decode_still(std::span<const uint8_t> bytes, PixelFamily jpeg_family);

// Returns the EXIF orientation of a PNG or JPEG, 1 to 8. It is 1 (upright) if the file has none.
int exif_orientation(std::span<const uint8_t> bytes);
// Returns a message that this project ignores the EXIF orientation, or an empty text for orientation 1.
std::string orientation_notice(int orientation);

// Finds the end of a JPEG in a stream of pictures. `bytes` must start with a JPEG. Returns the position after its EOI
// marker, or the position where the next picture starts, if there is no such marker before it. Returns nothing if
// `bytes` does not contain the end. Parses only the markers, and does not decode the picture.
std::optional<size_t> jpeg_end(std::span<const uint8_t> bytes);
// Returns true if a file that begins with `bytes` is a Motion JPEG stream, which consists of whole JPEG pictures of one
// size. A second picture that belongs to a still, such as a preview or a gain map (MPF), does not count.
bool is_jpeg_stream(std::span<const uint8_t> bytes);

// Encodes an RGB image as JPEG with quality 1 to 100. Throws Error.
std::vector<uint8_t> encode_jpeg(const Image& rgb, int quality);

// Writes grey samples of 8 or 16 bits, row by row without padding, as a PNG. Throws Error with the file's name.
void save_grey_png(std::span<const uint8_t> samples, int width, int height, const std::string& path);
void save_grey_png(std::span<const uint16_t> samples, int width, int height, const std::string& path);

// A grey image, stored row by row.
struct GreyImage {
  int width = 0, height = 0;
  std::vector<uint8_t> samples;
};

// Decodes only the luma of a JPEG, at 1 / `smaller` of its size, rounded up. `smaller` must be 1, 2, 4 or 8. Throws
// Error.
GreyImage decode_jpeg_luma(const std::vector<uint8_t>& bytes, int smaller);

}  // namespace lf
