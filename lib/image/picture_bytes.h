// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "image/image.h"

// Functions on the bytes of PNG and JPEG files. The camera source, the renderer and `lf-rig check` all decode stills with
// these functions, so that they agree on what is damaged.
namespace lf {

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

}  // namespace lf
