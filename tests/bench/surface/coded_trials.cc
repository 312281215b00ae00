// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/surface/coded_trials.h"

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <vector>

#include <opencv2/imgcodecs.hpp>

namespace lf::focus {

size_t code_as_jpeg(int quality, CameraTrials& trials) {
  const int width = trials.rect.width(), height = trials.rect.height() * static_cast<int>(trials.luma.size());
  std::vector<uint8_t> pixels;
  for (const std::vector<uint8_t>& plane : trials.luma) pixels.insert(pixels.end(), plane.begin(), plane.end());
  std::vector<uint8_t> jpeg;
  cv::imencode(".jpg", cv::Mat(height, width, CV_8UC1, pixels.data()), jpeg, {cv::IMWRITE_JPEG_QUALITY, quality});
  const cv::Mat decoded = cv::imdecode(jpeg, cv::IMREAD_GRAYSCALE);
  const uint8_t* from = decoded.ptr();
  for (std::vector<uint8_t>& plane : trials.luma) {
    std::copy_n(from, plane.size(), plane.begin());
    from += plane.size();
  }
  constexpr uint8_t kScan[] = {0xff, 0xda, 0, 8};  // start of scan with one component; ten bytes
  const auto scan = std::search(jpeg.begin(), jpeg.end(), std::begin(kScan), std::end(kScan));
  return static_cast<size_t>(jpeg.end() - scan) - 10 - 2;
}

}  // namespace lf::focus
