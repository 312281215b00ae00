// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "image/image.h"

namespace lf {

// PNG, JPEG and whatever else OpenCV's imgcodecs reads, as 8-bit RGB. Throws Error naming the file.
Image load_image(const std::string& path);
// By the name's ending: .png (lossless), .jpg (quality 95). Takes RGB. Throws Error naming the file.
void save_image(const Image& rgb, const std::string& path);

}  // namespace lf
