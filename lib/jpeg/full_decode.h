// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "image/image.h"

namespace lf::jpeg {

// Both decode a whole JPEG of any kind that libjpeg reads: progressive, several scans, arithmetic coding, any sampling;
// grey, YCbCr, RGB, CMYK or YCCK. They return nothing, and the cause in *reason, if any part of the frame is damaged.
// Thread-safe.

// Decodes to I420. Chroma of more than half resolution is averaged, chroma of less is repeated. The frame's header has
// passed parse_header().
std::optional<Image> decode_whole(std::span<const uint8_t> frame, std::string* reason);
// Decodes to RGB, with libjpeg's interpolation of chroma.
std::optional<Image> decode_rgb(std::span<const uint8_t> frame, std::string* reason);

}  // namespace lf::jpeg
