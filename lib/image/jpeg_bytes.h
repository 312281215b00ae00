// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "image/image.h"

namespace lf {

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
