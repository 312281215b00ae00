// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "image/image.h"

namespace lf::jpeg {

// A JPEG of any kind that libjpeg knows (progressive, several scans, arithmetic coding, any sampling) as I420; its
// chroma of more than half resolution is averaged, of less repeated. Nothing, and why in *reason, if it is damaged,
// even in parts, or neither grey nor YCbCr. Takes a frame whose header parse_header() has passed. Thread-safe.
std::optional<Image> decode_whole(std::span<const uint8_t> frame, std::string* reason);

}  // namespace lf::jpeg
