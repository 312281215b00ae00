// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/jpeg_bytes.h"

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "base/error.h"

namespace lf {

std::vector<uint8_t> encode_jpeg(const Image& rgb, int quality) {
  if (rgb.family() != PixelFamily::kRgb || rgb.data().empty()) throw Error("only RGB images can be encoded");
  std::vector<uint8_t> bytes;
  try {
    // OpenCV takes no picture to be read alone.
    const cv::Mat from(rgb.height(), rgb.width(), CV_8UC3, const_cast<uint8_t*>(rgb.data().data()));
    cv::Mat bgr;
    cv::cvtColor(from, bgr, cv::COLOR_RGB2BGR);
    cv::imencode(".jpg", bgr, bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
  } catch (const cv::Exception& error) {
    throw Error(error.what());
  }
  return bytes;
}

GreyPicture decode_grey_jpeg(const std::vector<uint8_t>& bytes, int smaller) {
  try {
    const cv::Mat grey = cv::imdecode(bytes, smaller == 8   ? cv::IMREAD_REDUCED_GRAYSCALE_8
                                             : smaller == 4 ? cv::IMREAD_REDUCED_GRAYSCALE_4
                                             : smaller == 2 ? cv::IMREAD_REDUCED_GRAYSCALE_2
                                                            : cv::IMREAD_GRAYSCALE);
    if (grey.empty()) throw Error("no JPEG");
    GreyPicture picture{grey.cols, grey.rows, {}};
    for (int y = 0; y < grey.rows; y++)
      picture.samples.insert(picture.samples.end(), grey.ptr<uint8_t>(y), grey.ptr<uint8_t>(y) + grey.cols);
    return picture;
  } catch (const cv::Exception& error) {
    throw Error(error.what());
  }
}

}  // namespace lf
