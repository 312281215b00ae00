// SPDX-License-Identifier: LGPL-2.1-or-later
// Apart from the pixels, so that whoever reads and writes no files loads no OpenCV.
#include <filesystem>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "base/error.h"
#include "image/image.h"

namespace lf {

Image load_image(const std::string& path) {
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) throw Error(path + ": no such image file");
  cv::Mat bgr;
  try {
    bgr = cv::imread(path, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception& e) {
    throw Error(path + ": " + e.what());
  }
  if (bgr.empty()) throw Error(path + ": not an image that can be read");
  Image image(PixelFamily::kRgb, bgr.cols, bgr.rows);
  cv::Mat rgb(bgr.rows, bgr.cols, CV_8UC3, image.data().data());
  cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
  return image;
}

void save_image(const Image& rgb, const std::string& path) {
  const cv::Mat in(rgb.height(), rgb.width(), CV_8UC3, const_cast<uint8_t*>(rgb.data().data()));
  cv::Mat bgr;
  cv::cvtColor(in, bgr, cv::COLOR_RGB2BGR);
  bool written = false;
  try {
    written = cv::imwrite(path, bgr);
  } catch (const cv::Exception& e) {
    throw Error(path + ": " + e.what());
  }
  if (!written) throw Error(path + ": can't be written");
}

}  // namespace lf
