// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "image/image.h"

namespace lf {

// An RGB image as a JPEG file, quality 1..100. Throws Error.
std::vector<uint8_t> encode_jpeg(const Image& rgb, int quality);

}  // namespace lf
