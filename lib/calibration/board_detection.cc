// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/board_detection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>

#include <opencv2/aruco/charuco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "base/text.h"

namespace lf {
namespace {

using Kind = CalibrationBoard::Kind;

constexpr int kMaxSide = 100;  // corners or tags along one side

// The search window of a corner must not reach other edges, which would bias the result.
constexpr double kWindowOfSpacing = 0.4;
constexpr int kMinWindow = 2, kMaxWindow = 15;  // half widths, pixels
constexpr size_t kMinCorners = 6;               // per view with markers; two more than pose estimation needs

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

cv::Ptr<cv::aruco::Dictionary> dictionary_of(const CalibrationBoard& board) {
  if (board.kind == Kind::kAprilGrid) return cv::aruco::getPredefinedDictionary(cv::aruco::DICT_APRILTAG_36h11);
  for (const auto& [name, id] : kDictionaries)
    if (board.dictionary == name) return cv::aruco::getPredefinedDictionary(id);
  std::string names;
  for (const auto& [name, id] : kDictionaries) names += (names.empty() ? "" : ", ") + std::string(name);
  throw Error("there is no marker dictionary " + board.dictionary + ": " + names);
}

cv::Mat grey_of(const Image& image) {
  const cv::Mat rgb(image.height(), image.width(), CV_8UC3, const_cast<uint8_t*>(image.data().data()));
  cv::Mat grey;
  cv::cvtColor(rgb, grey, cv::COLOR_RGB2GRAY);
  return grey;
}

int window_of(double spacing) {
  return std::clamp(static_cast<int>(kWindowOfSpacing * spacing), kMinWindow, kMaxWindow);
}

void refine_corners(const cv::Mat& grey, std::vector<cv::Point2f>& corners, int window) {
  cv::cornerSubPix(grey, corners, {window, window}, {-1, -1},
                   {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-4});
}

// Refines corners that markers predict. Removes a corner if its window leaves the image, or if the corner moves out of
// the window, because something hides the corner. `spacing` is as for window_of().
void refine_view(const cv::Mat& grey, BoardView& view, double spacing) {
  std::vector<cv::Point2f> corners;
  for (const Vec2& corner : view.corners)
    corners.emplace_back(static_cast<float>(corner.x), static_cast<float>(corner.y));
  if (corners.empty()) return;
  const int window = window_of(spacing);
  refine_corners(grey, corners, window);
  size_t kept = 0;
  for (size_t i = 0; i < corners.size(); i++) {
    const Vec2 at(corners[i].x, corners[i].y);
    const bool inside = at.x >= window && at.y >= window && at.x < grey.cols - window && at.y < grey.rows - window;
    if (!inside || glm::length(at - view.corners[i]) > window) continue;
    view.corners[kept] = at;
    view.ids[kept++] = view.ids[i];
  }
  view.corners.resize(kept), view.ids.resize(kept);
}

double least_spacing(const std::vector<cv::Point2f>& corners, int columns) {
  double least = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < corners.size(); i++) {
    if ((i + 1) % columns != 0) least = std::min(least, cv::norm(corners[i + 1] - corners[i]));
    if (i + columns < corners.size()) least = std::min(least, cv::norm(corners[i + columns] - corners[i]));
  }
  return least;
}

// OpenCV counts from either end. If the ends differ, corner 0 belongs to a black square in the corner of the board.
bool starts_at_black_square(const cv::Mat& grey, const std::vector<cv::Point2f>& corners, int columns) {
  const auto brightness = [&](size_t first) {
    const cv::Point2f middle =
        (corners[first] + corners[first + 1] + corners[first + columns] + corners[first + columns + 1]) / 4;
    cv::Mat patch;
    cv::getRectSubPix(grey, {3, 3}, middle, patch);
    return cv::mean(patch)[0];
  };
  return brightness(0) < brightness(1);
}

std::optional<BoardView> find_checkerboard(const cv::Mat& grey, const CalibrationBoard& board) {
  std::vector<cv::Point2f> corners;
  if (!cv::findChessboardCorners(grey, {board.columns, board.rows}, corners,
                                 cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE))
    return std::nullopt;
  refine_corners(grey, corners, window_of(least_spacing(corners, board.columns)));
  if (!board.is_symmetric() && !starts_at_black_square(grey, corners, board.columns)) std::ranges::reverse(corners);
  BoardView view;
  for (const cv::Point2f& corner : corners) view.corners.emplace_back(corner.x, corner.y);
  return view;
}

struct Marker {
  int id = 0;
  std::vector<cv::Point2f> image, board;  // the four corners, in the same order
};

cv::Point2f middle_of(const std::vector<cv::Point2f>& p) { return (p[0] + p[1] + p[2] + p[3]) / 4; }

// True if `b` is where `a` and the description of the board predict it. An affine prediction suffices for neighbours,
// and is less sensitive to noise than a homography.
bool agree(const Marker& a, const Marker& b) {
  const auto axes = [](const std::vector<cv::Point2f>& p) {
    const cv::Point2f u = p[1] - p[0] + p[2] - p[3], v = p[3] - p[0] + p[2] - p[1];
    return cv::Matx22f(u.x, v.x, u.y, v.y);
  };
  const cv::Point2f step = middle_of(b.board) - middle_of(a.board);
  const cv::Vec2f predicted = axes(a.image) * axes(a.board).inv() * cv::Vec2f(step.x, step.y);
  const cv::Point2f found = middle_of(b.image) - middle_of(a.image);
  return cv::norm(found - cv::Point2f(predicted)) < 0.5 * cv::norm(b.image[0] - b.image[1]);
}

// Compares neighbouring markers. Removes markers without an agreeing neighbour, unless they have no neighbours at all.
// Returns false if a third of the neighbours disagree: the board differs from its description.
bool remove_misplaced(std::vector<Marker>& markers, double reach) {
  std::vector<int> agreeing(markers.size()), neighbours(markers.size());
  int all = 0, good = 0;
  for (size_t i = 0; i < markers.size(); i++)
    for (size_t j = 0; j < markers.size(); j++) {
      if (i == j || cv::norm(markers[i].board[0] - markers[j].board[0]) > reach) continue;
      const bool fits = agree(markers[i], markers[j]);
      neighbours[i]++, all++;
      agreeing[i] += fits, good += fits;
    }
  if (3 * good < 2 * all) return false;
  size_t kept = 0;
  for (size_t i = 0; i < markers.size(); i++)
    if (neighbours[i] == 0 || 2 * agreeing[i] >= neighbours[i]) {
      if (kept != i) markers[kept] = std::move(markers[i]);
      kept++;
    }
  markers.resize(kept);
  return true;
}

// The markers of a ChArUco board in the units of squares. OpenCV 4.6 draws only its own layout. A legacy board with an
// even number of rows of squares is OpenCV's board with one more row at the top, without this row.
struct CharucoLayout {
  cv::Ptr<cv::aruco::CharucoBoard> board;
  int extra_rows = 0, extra_markers = 0;

  explicit CharucoLayout(const CalibrationBoard& b) {
    const int columns = b.columns + 1, rows = b.rows + 1;
    if (b.legacy && rows % 2 == 0) extra_rows = 1, extra_markers = columns / 2;
    board =
        cv::aruco::CharucoBoard::create(columns, rows + extra_rows, 1, static_cast<float>(b.marker), dictionary_of(b));
  }
};

struct FoundMarkers {
  std::vector<Marker> markers;  // at their places
  size_t foreign = 0;           // markers that the board does not have
  bool fit = true;              // the board agrees with its description
};

FoundMarkers sort_markers(const std::vector<std::vector<cv::Point2f>>& outlines, const std::vector<int>& ids,
                          const std::vector<std::vector<cv::Point2f>>& places, double reach) {
  FoundMarkers found;
  for (size_t i = 0; i < ids.size(); i++) {
    if (ids[i] < 0 || ids[i] >= static_cast<int>(places.size()) || places[static_cast<size_t>(ids[i])].empty())
      found.foreign++;
    else
      found.markers.push_back({ids[i], outlines[i], places[static_cast<size_t>(ids[i])]});
  }
  found.fit = remove_misplaced(found.markers, reach) && found.foreign <= found.markers.size();
  return found;
}

double least_side(const std::vector<Marker>& markers) {
  double side = std::numeric_limits<double>::infinity();
  for (const Marker& marker : markers)
    for (int k = 0; k < 4; k++) side = std::min(side, cv::norm(marker.image[k] - marker.image[(k + 1) % 4]));
  return side;
}

bool is_enough(const BoardView& view, int columns) {
  std::set<int> x, y;
  for (const int id : view.ids) x.insert(id % columns), y.insert(id / columns);
  return view.ids.size() >= kMinCorners && x.size() >= 2 && y.size() >= 2;
}

std::optional<BoardView> find_charuco(const cv::Mat& grey, const CalibrationBoard& board, BoardMiss& miss) {
  const CharucoLayout layout(board);
  std::vector<std::vector<cv::Point2f>> outlines;
  std::vector<int> ids;
  cv::aruco::detectMarkers(grey, layout.board->dictionary, outlines, ids);
  if (ids.empty()) return std::nullopt;
  std::vector<std::vector<cv::Point2f>> places(layout.board->ids.size() - layout.extra_markers);
  for (size_t i = 0; i < places.size(); i++)
    for (const cv::Point3f& p : layout.board->objPoints[i + layout.extra_markers]) places[i].emplace_back(p.x, p.y);
  const FoundMarkers found = sort_markers(outlines, ids, places, 2.1);
  miss = found.fit ? BoardMiss::kPartial : BoardMiss::kOtherBoard;
  if (!found.fit || found.markers.empty()) return std::nullopt;
  outlines.clear(), ids.clear();
  for (const Marker& marker : found.markers) {
    outlines.push_back(marker.image);
    ids.push_back(marker.id + layout.extra_markers);
  }
  std::vector<cv::Point2f> corners;
  std::vector<int> corner_ids;
  cv::aruco::interpolateCornersCharuco(outlines, ids, grey, layout.board, corners, corner_ids);
  BoardView view;
  for (size_t i = 0; i < corners.size(); i++) {
    const cv::Point3f at = layout.board->chessboardCorners[corner_ids[i]];
    const int column = static_cast<int>(std::lround(at.x)) - 1;
    const int row = static_cast<int>(std::lround(at.y)) - 1 - layout.extra_rows;
    if (row < 0) continue;
    view.ids.push_back(row * board.columns + column);
    // The aruco module puts pixel edges, not pixel centres, at integers.
    view.corners.emplace_back(corners[i].x - 0.5, corners[i].y - 0.5);
  }
  // OpenCV's windows reach the markers. A marker is half of (1 - marker) squares away.
  refine_view(grey, view, least_side(found.markers) / board.marker * (1 - board.marker));
  if (!is_enough(view, board.columns)) return std::nullopt;
  return view;
}

// OpenCV's corner k of a tag is corner kUpright[k] of the upright tag: top left, top right, bottom right, bottom left.
// OpenCV stores the family 36h11 upside down.
constexpr std::array kUpright = {2, 3, 0, 1};
constexpr int kKalibrBorder = 2, kUsualBorder = 1;  // width of the black border, in bits of the tag
constexpr int kTagBits = 6;

// Corner of an upright tag, as an index of the corner grid. Kalibr counts tags from the bottom left, row by row.
int april_corner(const CalibrationBoard& board, int tag, int corner) {
  const int column = 2 * (tag % board.columns) + (corner == 1 || corner == 2);
  const int row = 2 * (board.rows - 1 - tag / board.columns) + (corner == 2 || corner == 3);
  return row * board.grid_columns() + column;
}

// Moves the corners of an outline outwards, by `distance` pixels along each side.
void grow(std::vector<cv::Point2f>& outline, float distance) {
  const std::vector<cv::Point2f> before = outline;
  for (size_t k = 0; k < 4; k++)
    for (const size_t other : {(k + 1) % 4, (k + 3) % 4}) {
      const cv::Point2f side = before[k] - before[other];
      outline[k] += side * (distance / std::max(1.0F, static_cast<float>(cv::norm(side))));
    }
}

// Small black squares touch the corners of Kalibr's tags, so that blurred tags look connected. A maximum filter
// separates tags, and makes them smaller.
FoundMarkers find_tags(const cv::Mat& grey, const CalibrationBoard& board) {
  std::vector<std::vector<cv::Point2f>> places(static_cast<size_t>(board.columns) * board.rows);
  for (size_t tag = 0; tag < places.size(); tag++)
    for (const int corner : kUpright) {
      const Vec2 at = board.corner(april_corner(board, static_cast<int>(tag), corner)) / board.square;
      places[tag].emplace_back(static_cast<float>(at.x), static_cast<float>(at.y));
    }
  FoundMarkers best;
  for (const int border : {kKalibrBorder, kUsualBorder}) {
    if (!best.markers.empty()) break;
    for (const int separation : {1, 3, 5}) {
      cv::Mat separated;
      cv::dilate(grey, separated, cv::Mat::ones(separation, separation, CV_8U));
      const cv::Ptr<cv::aruco::DetectorParameters> parameters = cv::aruco::DetectorParameters::create();
      parameters->markerBorderBits = border;
      std::vector<std::vector<cv::Point2f>> outlines;
      std::vector<int> ids;
      cv::aruco::detectMarkers(separated, dictionary_of(board), outlines, ids, parameters);
      for (auto& outline : outlines) grow(outline, static_cast<float>(separation - 1) / 2);
      FoundMarkers found = sort_markers(outlines, ids, places, 1.1 * (1 + board.gap));
      const bool better =
          found.markers.size() > best.markers.size() || (best.markers.empty() && found.foreign > best.foreign);
      if (better) best = std::move(found);
      if (best.markers.size() == places.size()) return best;
    }
  }
  return best;
}

std::optional<BoardView> find_april_grid(const cv::Mat& grey, const CalibrationBoard& board, BoardMiss& miss) {
  const FoundMarkers found = find_tags(grey, board);
  if (found.markers.empty() && found.foreign == 0) return std::nullopt;
  miss = found.fit ? BoardMiss::kPartial : BoardMiss::kOtherBoard;
  if (!found.fit) return std::nullopt;
  BoardView view;
  for (const Marker& marker : found.markers)
    for (int k = 0; k < 4; k++) {
      view.ids.push_back(april_corner(board, marker.id, kUpright[k]));
      view.corners.emplace_back(marker.image[k].x, marker.image[k].y);
    }
  // A corner is next to the border of the tag and to the gap.
  const double border = double{kKalibrBorder} / (kTagBits + 2 * kKalibrBorder);
  refine_view(grey, view, 2 * least_side(found.markers) * std::min(board.gap, border));
  if (!is_enough(view, board.grid_columns())) return std::nullopt;
  return view;
}

}  // namespace

Vec2 CalibrationBoard::corner(size_t i) const {
  const auto wide = static_cast<size_t>(grid_columns());
  const auto place = [&](size_t k) {
    if (kind != Kind::kAprilGrid) return static_cast<double>(k);
    return static_cast<double>(k / 2) * (1 + gap) + static_cast<double>(k % 2);
  };
  return Vec2(place(i % wide), place(i / wide)) * square;
}

std::string CalibrationBoard::name() const {
  const std::string size = std::to_string(columns) + "x" + std::to_string(rows);
  switch (kind) {
    case Kind::kCharuco: return "ChArUco board of " + size + " inner corners (" + dictionary + ")";
    case Kind::kAprilGrid: return "AprilGrid of " + size + " tags";
    case Kind::kCheckerboard: break;
  }
  return "board of " + size + " inner corners";
}

void check_board(const CalibrationBoard& board) {
  const int least = board.kind == Kind::kCheckerboard ? 3 : board.kind == Kind::kCharuco ? 2 : 1;
  if (board.columns < least || board.rows < least || board.columns > kMaxSide || board.rows > kMaxSide)
    throw Error("a " + board.name() + " is not possible: both numbers must be from " + std::to_string(least) + " to " +
                std::to_string(kMaxSide));
  if (!(board.square > 0 && is_finite(board.square)))
    throw Error("the squares or tags of a board need a positive size in metres");
  if (board.kind == Kind::kCheckerboard) return;
  if (board.kind == Kind::kCharuco && !(board.marker > 0 && board.marker < 1))
    throw Error(
        "the markers of a ChArUco board must be smaller than its squares; give their side as a fraction below 1");
  if (board.kind == Kind::kAprilGrid && !(board.gap > 0 && board.gap <= 10))
    throw Error("the gap between the tags of an AprilGrid must be positive, as a fraction of the side of a tag");
  const int known = dictionary_of(board)->bytesList.rows;
  const int markers =
      board.kind == Kind::kAprilGrid ? board.columns * board.rows : (board.columns + 1) * (board.rows + 1) / 2;
  if (known < markers)
    throw Error("dictionary " + (board.kind == Kind::kAprilGrid ? "36h11" : board.dictionary) + " has " +
                std::to_string(known) + " markers, the board " + std::to_string(markers));
}

std::optional<BoardView> find_board(const Image& image, const CalibrationBoard& board, BoardMiss* miss) {
  BoardMiss ignored;
  BoardMiss& why = miss ? *miss : ignored;
  why = BoardMiss::kNothing;
  cv::Mat grey = grey_of(image);
  if (board.inverted) cv::bitwise_not(grey, grey);
  switch (board.kind) {
    case Kind::kCharuco: return find_charuco(grey, board, why);
    case Kind::kAprilGrid: return find_april_grid(grey, board, why);
    case Kind::kCheckerboard: break;
  }
  return find_checkerboard(grey, board);
}

}  // namespace lf
