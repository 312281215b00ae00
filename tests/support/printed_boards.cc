// SPDX-License-Identifier: LGPL-2.1-or-later
#include "support/printed_boards.h"

#include <cmath>

#include <opencv2/aruco.hpp>
#include <opencv2/imgproc.hpp>

namespace lf::test {

void draw_marker(cv::Mat& print, int dictionary, int id, const cv::Rect& at, int border, bool half_turn) {
  const cv::Ptr<cv::aruco::Dictionary> markers = cv::aruco::getPredefinedDictionary(dictionary);
  const int bits = markers->markerSize + 2 * border;
  cv::Mat drawn;
  markers->drawMarker(id, bits, drawn, border);
  if (half_turn) cv::rotate(drawn, drawn, cv::ROTATE_180);
  for (int y = 0; y < at.height; y++)
    for (int x = 0; x < at.width; x++)
      print.at<uint8_t>(at.y + y, at.x + x) = drawn.at<uint8_t>(y * bits / at.height, x * bits / at.width);
}

namespace {

// A ChArUco board with markers of 0.7 squares of the dictionary 5X5_100. New boards begin with a black square at the
// top left. Legacy boards with an even number of rows of squares begin with a white one.
Print print_charuco(const CalibrationBoard& board) {
  constexpr int kSquare = 50;
  const int columns = board.columns + 1, rows = board.rows + 1, margin = kSquare;
  Print print{cv::Mat(rows * kSquare + 2 * margin, columns * kSquare + 2 * margin, CV_8U, cv::Scalar(255)), kSquare,
              Vec2(margin + kSquare, margin + kSquare)};
  const int side = static_cast<int>(std::lround(board.marker * kSquare)), inset = (kSquare - side) / 2;
  int id = 0;
  for (int y = 0; y < rows; y++)
    for (int x = 0; x < columns; x++) {
      const cv::Rect square(margin + x * kSquare, margin + y * kSquare, kSquare, kSquare);
      const bool black = (x + y) % 2 == (board.legacy && rows % 2 == 0 ? 1 : 0);
      if (black)
        print.picture(square) = 0;
      else
        draw_marker(print.picture, cv::aruco::DICT_5X5_100, id++, {square.x + inset, square.y + inset, side, side}, 1,
                    false);
    }
  if (board.inverted) cv::bitwise_not(print.picture, print.picture);
  return print;
}

// An AprilGrid as Kalibr prints it: tags with a border of two bits, counted from the bottom left, and small black
// squares at their corners.
Print print_april_grid(const CalibrationBoard& board) {
  constexpr int kTag = 100;
  const int gap = static_cast<int>(std::lround(board.gap * kTag)), pitch = kTag + gap, margin = 2 * gap;
  Print print{cv::Mat(board.rows * pitch + 2 * margin, board.columns * pitch + 2 * margin, CV_8U, cv::Scalar(255)),
              kTag, Vec2(margin, margin)};
  for (int row = 0; row < board.rows; row++)
    for (int column = 0; column < board.columns; column++) {
      const int x = margin + column * pitch, y = margin + (board.rows - 1 - row) * pitch;
      draw_marker(print.picture, cv::aruco::DICT_APRILTAG_36h11, row * board.columns + column, {x, y, kTag, kTag}, 2,
                  true);
      for (const int dx : {-gap, kTag})
        for (const int dy : {-gap, kTag}) print.picture(cv::Rect(x + dx, y + dy, gap, gap)) = 0;
    }
  return print;
}

// A checkerboard with a black square at the top left.
Print print_checkerboard(const CalibrationBoard& board) {
  constexpr int kSquare = 50;
  Print print{cv::Mat((board.rows + 3) * kSquare, (board.columns + 3) * kSquare, CV_8U, cv::Scalar(255)), kSquare,
              Vec2(2 * kSquare, 2 * kSquare)};
  for (int y = 0; y <= board.rows; y++)
    for (int x = 0; x <= board.columns; x++)
      if ((x + y) % 2 == 0) print.picture(cv::Rect((x + 1) * kSquare, (y + 1) * kSquare, kSquare, kSquare)) = 0;
  return print;
}

}  // namespace

Print print_of(const CalibrationBoard& board) {
  switch (board.kind) {
    case CalibrationBoard::Kind::kCharuco: return print_charuco(board);
    case CalibrationBoard::Kind::kAprilGrid: return print_april_grid(board);
    case CalibrationBoard::Kind::kCheckerboard: break;
  }
  return print_checkerboard(board);
}

PrintCamera::PrintCamera(const Lens& lens, int width, int height) : width_(width), height_(height) {
  rays_.reserve(static_cast<size_t>(width) * height * kSamples * kSamples);
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++)
      for (int s = 0; s < kSamples * kSamples; s++) {
        const Vec2 sample(x + (s % kSamples + 0.5) / kSamples - 0.5, y + (s / kSamples + 0.5) / kSamples - 0.5);
        const auto ray = lens.unproject(sample);
        rays_.push_back(ray ? Vec3(*ray, 1) : Vec3(0, 0, 1));
      }
}

Image PrintCamera::photograph(const Print& print, double square, const Pose& camera_from_board) const {
  Image image(PixelFamily::kRgb, width_, height_);
  const Vec3 normal = camera_from_board.rotation()[2];
  const double along = glm::dot(normal, camera_from_board.position);
  auto ray = rays_.begin();
  for (int y = 0; y < height_; y++)
    for (int x = 0; x < width_; x++) {
      double sum = 0;
      for (int s = 0; s < kSamples * kSamples; s++, ray++) {
        const Vec3 at = camera_from_board.camera_from_world(*ray * (along / glm::dot(normal, *ray)));
        const Vec2 on = print.first + Vec2(at) / square * print.per_unit;
        const int column = static_cast<int>(std::floor(on.x)), row = static_cast<int>(std::floor(on.y));
        const bool outside = column < 0 || row < 0 || column >= print.picture.cols || row >= print.picture.rows;
        sum += outside ? 160 : print.picture.at<uint8_t>(row, column);
      }
      const auto value = static_cast<uint8_t>(30 + 0.8 * sum / (kSamples * kSamples));
      for (int c = 0; c < 3; c++) image.pixel(x, y)[c] = value;
    }
  return image;
}

}  // namespace lf::test
