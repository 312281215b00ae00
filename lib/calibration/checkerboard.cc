// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/checkerboard.h"

#include <algorithm>
#include <limits>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace lf {
namespace {

// A window that reaches the next corner pulls towards it: with the usual fixed half width of 11 pixels one image of
// OpenCV's own set is off by more than a pixel. As wide as allowed averages most noise.
constexpr double kWindowOfSpacing = 0.4;
constexpr int kLeastWindow = 2, kMostWindow = 15;  // half widths, pixels

double least_spacing(const std::vector<cv::Point2f>& corners, int columns) {
  double least = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < corners.size(); i++) {
    if ((i + 1) % columns != 0) least = std::min(least, cv::norm(corners[i + 1] - corners[i]));
    if (i + columns < corners.size()) least = std::min(least, cv::norm(corners[i + columns] - corners[i]));
  }
  return least;
}

}  // namespace

std::optional<std::vector<Vec2>> find_checkerboard(const Image& image, const Checkerboard& board) {
  const cv::Mat rgb(image.height(), image.width(), CV_8UC3, const_cast<uint8_t*>(image.data().data()));
  cv::Mat grey;
  cv::cvtColor(rgb, grey, cv::COLOR_RGB2GRAY);
  std::vector<cv::Point2f> corners;
  if (!cv::findChessboardCorners(grey, {board.columns, board.rows}, corners,
                                 cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE))
    return std::nullopt;
  const int window =
      std::clamp(static_cast<int>(kWindowOfSpacing * least_spacing(corners, board.columns)), kLeastWindow, kMostWindow);
  cv::cornerSubPix(grey, corners, {window, window}, {-1, -1},
                   {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-4});
  std::vector<Vec2> result;
  for (const cv::Point2f& corner : corners) result.emplace_back(corner.x, corner.y);
  return result;
}

}  // namespace lf
