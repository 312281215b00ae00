// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>

namespace lf {

// OpenCV shows damaged TIFF and WebP files with black or wrong parts. These functions find the damage.

// Decodes all pixels of the first image of a TIFF file with libtiff. Returns the first error of the decoder, or an
// empty text if the file is undamaged. Call it only for sizes below the limits of image_file.h. Thread-safe.
std::string tiff_damage(std::span<const uint8_t> bytes);

// WebP has no checksum, but a decoder that hits damage reads too few or too many bytes. The decoder reports missing
// bytes. This function finds bytes that the decoder does not read: `decodes` must then also accept a file without its
// last bytes. Returns a reason, or an empty text if the file is undamaged.
std::string webp_damage(std::span<const uint8_t> bytes, const std::function<bool(std::span<const uint8_t>)>& decodes);

}  // namespace lf
