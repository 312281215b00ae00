// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/depth_file.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include <opencv2/imgcodecs.hpp>

#include "base/file.h"
#include "base/text.h"

namespace lf {

namespace {

void save_png(const cv::Mat& pixels, const std::string& path) {
  std::vector<uint8_t> bytes;
  try {
    cv::imencode(".png", pixels, bytes);
  } catch (const cv::Exception& error) {
    throw Error(path + ": " + error.what());
  }
  AtomicFileWriter file(path);
  file.write({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  file.commit();
}

}  // namespace

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
  cv::Mat pixels(image.height, image.width, CV_16UC1);
  std::ranges::transform(image.depths, pixels.begin<uint16_t>(), [](float depth) {
    return static_cast<uint16_t>(std::lround(std::min(depth * kMillimetres, 65535.0f)));
  });
  save_png(pixels, path);
}

void save_confidence_png(const FocalMap* confidence, int width, int height, const std::string& path) {
  cv::Mat pixels = cv::Mat::zeros(height, width, CV_8UC1);
  std::vector<float> row(static_cast<size_t>(width));
  for (int y = 0; confidence && y < height; y++) {
    confidence->inverse_row(0, 1, y, width, row.data());
    std::ranges::transform(row, pixels.ptr<uint8_t>(y),
                           [](float value) { return static_cast<uint8_t>(std::lround(255 * value)); });
  }
  save_png(pixels, path);
}

}  // namespace lf
