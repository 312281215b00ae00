// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include <opencv2/core.hpp>

#include "calibration/board_detection.h"
#include "geometry/lens.h"
#include "geometry/pose.h"
#include "image/image.h"

namespace lf::test {

// Boards as they are printed, drawn from the descriptions of their layouts, without the boards of OpenCV.

struct Print {
  cv::Mat picture;      // dark on white
  double per_unit = 0;  // pixels per square or tag
  Vec2 first{0, 0};     // pixel edge of corner 0
};

// Draws a marker with black = 0; `border` is the width of the black border in bits.
void draw_marker(cv::Mat& print, int dictionary, int id, const cv::Rect& at, int border, bool half_turn);
Print print_of(const CalibrationBoard& board);

// A camera that takes pictures of prints, with 3x3 samples per pixel.
class PrintCamera {
 public:
  PrintCamera(const Lens& lens, int width, int height);

  // The axes of the board are those of CalibrationBoard::corner(), in metres.
  Image photograph(const Print& print, double square, const Pose& camera_from_board) const;

 private:
  static constexpr int kSamples = 3;  // per pixel, horizontally and vertically

  int width_, height_;
  std::vector<Vec3> rays_;  // one per sample, pixel by pixel
};

}  // namespace lf::test
