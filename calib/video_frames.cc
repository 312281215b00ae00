// SPDX-License-Identifier: LGPL-2.1-or-later
#include "video_frames.h"

#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "base/error.h"

namespace lf {

void for_each_frame(const std::string& uri, const std::function<bool(const Image&)>& use) {
  if (uri.find('"') != std::string::npos) throw Error(uri + ": has a quotation mark");
  const bool file = uri.starts_with("file:");
  const std::string pipeline = "uridecodebin uri=\"" + uri + "\" ! videoconvert ! video/x-raw,format=BGR ! appsink " +
                               (file ? "sync=false" : "max-buffers=1 drop=true");
  cv::VideoCapture video(pipeline, cv::CAP_GSTREAMER);
  cv::Mat bgr;
  bool any = false;
  while (video.isOpened() && video.read(bgr)) {
    any = true;
    Image image(PixelFamily::kRgb, bgr.cols, bgr.rows);
    cv::Mat rgb(bgr.rows, bgr.cols, CV_8UC3, image.data().data());
    cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
    if (!use(image)) return;
  }
  if (!any) throw Error(uri + ": no video could be had from it");
}

}  // namespace lf
