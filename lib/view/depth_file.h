// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "view/depth_image.h"

namespace lf {

// Writes a Portable Float Map (http://www.pauldebevec.com/Research/HDR/PFM/): 32-bit floats in metres, little-endian,
// bottom row first. Throws Error with the file's name.
void save_depth_pfm(const DepthImage& image, const std::string& path);
// Writes a PNG with 16 bits per pixel, in millimetres. Depths of 65.5 m and more are stored as 65535. Throws Error with
// the file's name.
void save_depth_png(const DepthImage& image, const std::string& path);
// Writes a PNG with 8 bits per pixel: the confidences of the depths of a picture of width x height pixels, from 0 to
// 255. `confidence` is a map as of DepthConfidence, or null, which means that all confidences are 0. Throws Error with
// the file's name.
void save_confidence_png(const FocalMap* confidence, int width, int height, const std::string& path);

}  // namespace lf
