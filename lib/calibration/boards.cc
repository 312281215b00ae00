// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/boards.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include <opencv2/aruco/charuco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "base/error.h"

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

namespace {

constexpr size_t kLeastCorners = 6;  // of a view: two more than its pose and no lens at all would take

using Name = std::pair<const char*, cv::aruco::PREDEFINED_DICTIONARY_NAME>;
constexpr std::array kDictionaries = {Name("4X4_50", cv::aruco::DICT_4X4_50),
                                      Name("4X4_100", cv::aruco::DICT_4X4_100),
                                      Name("4X4_250", cv::aruco::DICT_4X4_250),
                                      Name("4X4_1000", cv::aruco::DICT_4X4_1000),
                                      Name("5X5_50", cv::aruco::DICT_5X5_50),
                                      Name("5X5_100", cv::aruco::DICT_5X5_100),
                                      Name("5X5_250", cv::aruco::DICT_5X5_250),
                                      Name("5X5_1000", cv::aruco::DICT_5X5_1000),
                                      Name("6X6_50", cv::aruco::DICT_6X6_50),
                                      Name("6X6_100", cv::aruco::DICT_6X6_100),
                                      Name("6X6_250", cv::aruco::DICT_6X6_250),
                                      Name("6X6_1000", cv::aruco::DICT_6X6_1000),
                                      Name("7X7_50", cv::aruco::DICT_7X7_50),
                                      Name("7X7_100", cv::aruco::DICT_7X7_100),
                                      Name("7X7_250", cv::aruco::DICT_7X7_250),
                                      Name("7X7_1000", cv::aruco::DICT_7X7_1000),
                                      Name("ARUCO_ORIGINAL", cv::aruco::DICT_ARUCO_ORIGINAL)};

cv::Ptr<cv::aruco::Dictionary> dictionary_of(const CharucoBoard& board) {
  for (const auto& [name, id] : kDictionaries)
    if (board.dictionary == name) return cv::aruco::getPredefinedDictionary(id);
  std::string names;
  for (const auto& [name, id] : kDictionaries) names += (names.empty() ? "" : ", ") + std::string(name);
  throw Error("there is no dictionary of markers " + board.dictionary + ": " + names);
}

// In squares.
cv::Ptr<cv::aruco::CharucoBoard> opencv_board(const CharucoBoard& board) {
  return cv::aruco::CharucoBoard::create(board.corners.columns + 1, board.corners.rows + 1, 1,
                                         static_cast<float>(board.marker), dictionary_of(board));
}

}  // namespace

void check_charuco_board(const CharucoBoard& board) {
  if (!(board.marker > 0 && board.marker < 1))
    throw Error("the markers of a ChArUco board must be smaller than its squares");
  const int markers = (board.corners.columns + 1) * (board.corners.rows + 1) / 2;
  if (const int known = dictionary_of(board)->bytesList.rows; known < markers)
    throw Error("dictionary " + board.dictionary + " has " + std::to_string(known) + " markers, the board " +
                std::to_string(markers));
}

std::optional<BoardView> find_charuco(const Image& image, const CharucoBoard& board) {
  const cv::Mat rgb(image.height(), image.width(), CV_8UC3, const_cast<uint8_t*>(image.data().data()));
  cv::Mat grey;
  cv::cvtColor(rgb, grey, cv::COLOR_RGB2GRAY);
  const cv::Ptr<cv::aruco::CharucoBoard> markers = opencv_board(board);
  std::vector<std::vector<cv::Point2f>> outlines;
  std::vector<int> marker_ids, corner_ids;
  cv::aruco::detectMarkers(grey, markers->dictionary, outlines, marker_ids);
  if (marker_ids.empty()) return std::nullopt;
  std::vector<cv::Point2f> corners;
  cv::aruco::interpolateCornersCharuco(outlines, marker_ids, grey, markers, corners, corner_ids);
  BoardView view;
  std::set<int> columns, rows;
  for (size_t i = 0; i < corners.size(); i++) {
    // In squares from the outer corner of the board, however OpenCV counts.
    const cv::Point3f at = markers->chessboardCorners[corner_ids[i]];
    const int column = static_cast<int>(std::lround(at.x)) - 1, row = static_cast<int>(std::lround(at.y)) - 1;
    columns.insert(column);
    rows.insert(row);
    view.ids.push_back(row * board.corners.columns + column);
    // The aruco module's pixels end at whole numbers; everybody else's have their centres there.
    view.corners.emplace_back(corners[i].x - 0.5, corners[i].y - 0.5);
  }
  if (view.corners.size() < kLeastCorners || columns.size() < 2 || rows.size() < 2) return std::nullopt;
  return view;
}

namespace {

constexpr double kStillBoard = 0.003;  // of the image's width, from frame to frame: 1 pixel of 320
constexpr double kOther = 0.05;   // that the corners moved by on average

// The mean distance of the corners that both show.
double distance(const BoardView& a, const BoardView& b) {
  std::map<size_t, Vec2> corners;
  for (size_t i = 0; i < a.corners.size(); i++) corners.emplace(a.id(i), a.corners[i]);
  double sum = 0, count = 0;
  for (size_t i = 0; i < b.corners.size(); i++)
    if (const auto found = corners.find(b.id(i)); found != corners.end())
      sum += glm::length(found->second - b.corners[i]), count++;
  return count > 0 ? sum / count : std::numeric_limits<double>::infinity();
}

}  // namespace

bool ViewChooser::take(const BoardView& view) {
  const bool still = distance(last_, view) < kStillBoard * width_;
  last_ = view;
  if (!still) return false;
  if (std::any_of(kept_.begin(), kept_.end(), [&](const auto& k) { return distance(k, view) < kOther * width_; }))
    return false;
  kept_.push_back(view);
  return true;
}

}  // namespace lf
