// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/depth_file.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <vector>

#include "base/file.h"
#include "base/text.h"
#include "image/image_file.h"

namespace lf {

void save_depth_pfm(const DepthImage& image, const std::string& path) {
  static_assert(std::endian::native == std::endian::little);
  AtomicFileWriter file(path);
  file.write("Pf\n" + std::to_string(image.width) + " " + std::to_string(image.height) + "\n-1\n");  // little-endian
  for (int y = image.height - 1; y >= 0; y--)
    file.write({reinterpret_cast<const char*>(image.depths.data() + static_cast<size_t>(y) * image.width),
                static_cast<size_t>(image.width) * sizeof(float)});
  file.commit();
}

void save_depth_png(const DepthImage& image, const std::string& path) {
  constexpr float kMillimetres = 1000;
  std::vector<uint16_t> pixels(image.depths.size());
  std::ranges::transform(image.depths, pixels.begin(), [](float depth) {
    return static_cast<uint16_t>(std::lround(std::min(depth * kMillimetres, 65535.0f)));
  });
  save_grey_png(pixels, image.width, image.height, path);
}

void save_confidence_png(const FocalMap* confidence, int width, int height, const std::string& path) {
  std::vector<uint8_t> pixels(static_cast<size_t>(width) * static_cast<size_t>(height));
  std::vector<float> row(static_cast<size_t>(width));
  for (int y = 0; confidence && y < height; y++) {
    confidence->inverse_row(0, 1, y, width, row.data());
    std::ranges::transform(row, pixels.begin() + ptrdiff_t{y} * width,
                           [](float value) { return static_cast<uint8_t>(std::lround(255 * value)); });
  }
  save_grey_png(pixels, width, height, path);
}

}  // namespace lf
