// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include "image/image.h"
#include "image/image_file.h"

namespace lf {

// Decodes the first image of a TIFF file, which must have the size `size`, with libtiff. The result is RGB, without
// rotation by the file's orientation. Throws Error, without the file's name, for any damage. Thread-safe.
Image decode_tiff(std::span<const uint8_t> bytes, ImageSize size);

// WebP has no checksum, but a decoder that hits damage reads too few or too many bytes. The decoder reports missing
// bytes. This function finds bytes that the decoder does not read: `decodes` must then also accept a file without its
// last bytes. Returns a reason, or an empty text if the file is undamaged.
std::string webp_damage(std::span<const uint8_t> bytes, const std::function<bool(std::span<const uint8_t>)>& decodes);

}  // namespace lf
