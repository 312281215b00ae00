// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include <tiffio.h>

#include "base/text.h"
#include "image/image.h"

namespace lf {

// Writes an RGB image as an uncompressed TIFF file.
inline void save_tiff(const Image& rgb, const std::string& path) {
  TIFF* tiff = TIFFOpen(path.c_str(), "w");
  if (!tiff) throw Error(path + ": can't be written");
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, rgb.width());
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, rgb.height());
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 3);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 8);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_RGB);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  for (int y = 0; y < rgb.height(); y++) TIFFWriteScanline(tiff, const_cast<uint8_t*>(rgb.pixel(0, y)), y, 0);
  TIFFClose(tiff);
}

}  // namespace lf
