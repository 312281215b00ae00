// SPDX-License-Identifier: LGPL-2.1-or-later
#include "board_recordings.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <optional>
#include <utility>

#include "base/maths.h"
#include "base/text.h"
#include "image/image.h"
#include "recordings.h"

void add_board_options(cli::App& command, BoardOptions& options, bool needs_size) {
  command
      .add_option("--board", options.size,
                  "Number of inner corners of the board along x and y, for example 9x6. Inner corners are points where "
                  "four squares meet. For an AprilGrid, the number of tags")
      ->required()
      ->type_name("CxR");
  cli::Option* square =
      command
          .add_option("--square", options.square,
                      "Side length of a square of the board, in metres, or of a tag of an AprilGrid. It determines "
                      "distances, but not lenses")
          ->check(cli::PositiveNumber);
  if (needs_size) square->required();
  cli::Option* charuco =
      command
          .add_option("--charuco", options.charuco,
                      "ArUco dictionary of the markers on a ChArUco board, for example 5X5_100. Without this option, "
                      "the board is a plain checkerboard. A ChArUco board need not be completely visible")
          ->type_name("5X5_100");
  command
      .add_option("--marker", options.marker,
                  "Side length of a marker of the ChArUco board, as a fraction of the side of a square. For example, "
                  "0.75 for markers of 30 mm in squares of 40 mm")
      ->check(cli::Range(0.01, 0.99))
      ->needs(charuco);
  command
      .add_flag("--legacy", options.legacy,
                "The ChArUco board has the layout of OpenCV before 4.6: with an even number of rows of squares, the "
                "square at the top left is white")
      ->needs(charuco);
  command.add_flag("--inverted", options.inverted, "Black and white are swapped on the ChArUco board")->needs(charuco);
  command
      .add_option("--april-grid", options.gap,
                  "The board is an AprilGrid of Kalibr. The value is the distance between two tags, as a fraction of "
                  "the side of a tag (Kalibr: tagSpacing), for example 0.3")
      ->type_name("GAP")
      ->check(cli::Range(0.01, 10.0))
      ->excludes(charuco);
}

lf::CalibrationBoard parse_board(const BoardOptions& options) {
  lf::CalibrationBoard board;
  char rest = 0;
  if (std::sscanf(options.size.c_str(), "%dx%d%c", &board.columns, &board.rows, &rest) != 2)
    throw lf::Error("--board " + options.size +
                    ": must be the number of inner corners (or of tags) along x and y, such as 9x6");
  using Kind = lf::CalibrationBoard::Kind;
  board.kind = options.gap > 0 ? Kind::kAprilGrid : !options.charuco.empty() ? Kind::kCharuco : Kind::kCheckerboard;
  board.square = options.square;
  board.dictionary = options.charuco;
  board.marker = options.marker;
  board.legacy = options.legacy;
  board.inverted = options.inverted;
  if (options.gap > 0) board.gap = options.gap;
  try {
    lf::check_board(board);
  } catch (const lf::Error& e) {
    throw lf::Error("--board " + options.size + ": " + e.what());
  }
  return board;
}

std::string advice_for(const lf::CalibrationBoard& board) {
  using Kind = lf::CalibrationBoard::Kind;
  switch (board.kind) {
    case Kind::kCharuco:
      return "Check the dictionary in --charuco, and --inverted. --board counts the corners between squares, not the "
             "squares. The board must be flat and in even light";
    case Kind::kAprilGrid:
      return "--board counts the tags of the family 36h11 along x and y. The board must be flat and in even light";
    case Kind::kCheckerboard: break;
  }
  return "Check that --board counts the corners between squares, not the squares. The board must be flat, in even "
         "light, and completely visible in the image";
}

namespace {

constexpr double kCoarseInterval = 0.1;  // seconds between two searched frames, to find the clocks
constexpr int kColumns = 8, kRows = 6;

struct CameraViews {
  BoardRecordings::Camera counts;
  int width = 0, height = 0;
  std::map<std::string, lf::BoardView> pictures;  // by the number in the name
  std::vector<lf::BoardFilms::Frame> frames;      // of a video
  double frame_time = 0;                          // seconds between two searched frames of a video
};

// Returns the last number in the name of a file without leading zeros, or the name if it has no digits.
std::string picture_key(const std::string& path) {
  const std::string stem = std::filesystem::path(path).stem().string();
  const size_t last = stem.find_last_of("0123456789");
  if (last == std::string::npos) return stem;
  const size_t before = stem.find_last_not_of("0123456789", last);
  const std::string number = stem.substr(before == std::string::npos ? 0 : before + 1, last - before);
  const size_t first = std::min(number.find_first_not_of('0'), number.size() - 1);
  return number.substr(first);
}

class BoardFinder {
 public:
  BoardFinder(const lf::Camera& camera, const lf::CalibrationBoard& board) : board_(board) {
    found_.width = camera.width, found_.height = camera.height;
  }

  void add_picture(const std::string& path) {
    const lf::Image image = lf::load_image(path);
    check_size(image.width(), image.height(), path);
    auto view = find(image);
    if (!view) return;
    view->name = path;
    const std::string key = picture_key(path);
    if (const auto [other, is_new] = found_.pictures.emplace(key, *view); !is_new)
      throw lf::Error(other->second.name + " and " + path +
                      " end with the same number, but each picture of a camera shows another instant");
    found_.counts.views++;
  }

  // Searches the two frames before and the two frames after each of the `stamps`, which are increasing, in seconds.
  void add_video(const std::string& uri, const std::vector<double>& stamps,
                 const std::function<void(double)>& progress) {
    struct Waiting {
      lf::Image image;
      double time;
    };
    std::vector<Waiting> before;  // the last two frames, unless they have been searched
    std::vector<double> intervals;
    std::optional<double> last;
    bool after = false;  // the second frame after an instant comes next
    size_t next = 0;
    for_each_video_frame(uri, VideoFormat::kRgb, [&](const VideoFrame& frame) {
      check_size(frame.width, frame.height, uri);
      if (last && frame.time > *last) intervals.push_back(frame.time - *last);
      last = frame.time;
      bool wanted = std::exchange(after, false);
      for (; next < stamps.size() && stamps[next] <= frame.time; next++) wanted = after = true;
      if (after)
        for (const Waiting& waiting : before) add_frame(uri, waiting.image, waiting.time);
      if (wanted) {
        before.clear();
        add_frame(uri, frame.rgb(), frame.time);
      } else {
        if (before.size() == 2) before.erase(before.begin());
        before.push_back({frame.rgb(), frame.time});
      }
      progress(frame.progress);
      return after || next < stamps.size();
    });
    if (!intervals.empty()) found_.frame_time = lf::median(std::move(intervals));
  }

  // Searches a frame at most every kCoarseInterval.
  void add_video(const std::string& uri, const std::function<void(double)>& progress) {
    double next = 0;
    for_each_video_frame(uri, VideoFormat::kRgb, [&](const VideoFrame& frame) {
      check_size(frame.width, frame.height, uri);
      if (frame.time < next) return true;
      next = frame.time + 0.9 * kCoarseInterval;
      add_frame(uri, frame.rgb(), frame.time);
      progress(frame.progress);
      return true;
    });
  }

  CameraViews finish() {
    std::vector<char> cells(kColumns * kRows);
    const auto cover = [&](const lf::BoardView& view) {
      for (const lf::Vec2& corner : view.corners) {
        const int x = std::clamp(static_cast<int>((corner.x + 0.5) * kColumns / found_.width), 0, kColumns - 1);
        const int y = std::clamp(static_cast<int>((corner.y + 0.5) * kRows / found_.height), 0, kRows - 1);
        cells[static_cast<size_t>(y * kColumns + x)] = true;
      }
    };
    for (const auto& [key, view] : found_.pictures) cover(view);
    for (const lf::BoardFilms::Frame& frame : found_.frames) cover(frame.view);
    found_.counts.coverage = static_cast<double>(std::ranges::count(cells, 1)) / (kColumns * kRows);
    return std::move(found_);
  }

 private:
  std::optional<lf::BoardView> find(const lf::Image& image) {
    lf::BoardMiss miss;
    auto view = lf::find_board(image, board_, &miss);
    found_.counts.pictures++;
    if (!view) found_.counts.misses[static_cast<size_t>(miss)]++;
    return view;
  }

  void add_frame(const std::string& uri, const lf::Image& image, double time) {
    auto view = find(image);
    if (!view) return;
    view->name = lf::format_text("%s at %.3f s", uri.c_str(), time);
    found_.frames.push_back({time, std::move(*view)});
    found_.counts.views++;
  }

  void check_size(int width, int height, const std::string& name) {
    if (found_.width == 0) found_.width = width, found_.height = height;
    if (width != found_.width || height != found_.height)
      throw lf::Error(name + ": is " + lf::size_text(width, height) + ", but the camera has " +
                      lf::size_text(found_.width, found_.height));
  }

  const lf::CalibrationBoard& board_;
  CameraViews found_;
};

// Gives the pictures of all cameras their instants, in natural order of their numbers.
void add_pictures(std::vector<CameraViews>& cameras, lf::BoardSightings& sightings) {
  const auto natural = [](std::string_view a, std::string_view b) { return lf::natural_less(a, b); };
  std::map<std::string, uint32_t, decltype(natural)> numbers(natural);
  for (const CameraViews& camera : cameras)
    for (const auto& [key, view] : camera.pictures) numbers.emplace(key, 0);
  for (auto& [key, instant] : numbers) instant = static_cast<uint32_t>(sightings.num_instants++);
  for (uint32_t i = 0; i < cameras.size(); i++)
    for (auto& [key, view] : cameras[i].pictures) sightings.sightings.push_back({i, numbers[key], std::move(view), {}});
}

// Returns the times of `count` frames that are spread over a video.
std::vector<double> instants_of(const std::string& uri, int count) {
  std::vector<double> frames, times;
  for_each_video_frame(uri, VideoFormat::kGrey, [&](const VideoFrame& frame) {
    if (frames.empty() || frame.time > frames.back()) frames.push_back(frame.time);
    return true;
  });
  const size_t n = std::min(frames.size(), static_cast<size_t>(count));
  for (size_t i = 0; i < n; i++) times.push_back(frames[(2 * i + 1) * frames.size() / (2 * n)]);
  return times;
}

void require_views(const BoardRecordings& found, const lf::CalibrationBoard& board) {
  std::array<size_t, 3> misses{};
  size_t pictures = 0;
  for (const BoardRecordings::Camera& camera : found.cameras) {
    if (camera.views > 0) return;
    pictures += camera.pictures;
    for (size_t i = 0; i < misses.size(); i++) misses[i] += camera.misses[i];
  }
  if (const size_t other = misses[static_cast<size_t>(lf::BoardMiss::kOtherBoard)]; 2 * other > pictures)
    throw lf::Error(std::to_string(other) + " of " + std::to_string(pictures) +
                    " pictures show markers, but not at the places of a " + board.name() +
                    ". Count the numbers in --board again" +
                    (board.kind == lf::CalibrationBoard::Kind::kCharuco
                         ? ", and try --legacy: boards printed by old versions of OpenCV have another layout"
                         : ""));
  throw lf::Error("no picture shows the " + board.name() + ". " + advice_for(board));
}

using Search = std::function<void(BoardFinder& finder, size_t camera, const std::function<void(double)>& progress)>;

std::vector<CameraViews> search_all(const lf::Rig& rig, const lf::CalibrationBoard& board, int threads,
                                    const std::string& what, const Search& search) {
  std::vector<CameraViews> all(rig.cameras.size());
  for_each_recording(what, all.size(), threads, [&](size_t i, const auto& progress) {
    BoardFinder finder(rig.cameras[i], board);
    search(finder, i, progress);
    all[i] = finder.finish();
  });
  return all;
}

void keep_films(std::vector<CameraViews>& all, lf::BoardFilms& films) {
  films.frames.clear();
  films.frame_times.clear();
  for (CameraViews& camera : all) {
    films.frames.push_back(std::move(camera.frames));
    films.frame_times.push_back(camera.frame_time);
  }
}

// Searches videos and returns the views of each camera for the summary.
std::vector<CameraViews> search_videos(const lf::Rig& rig, const std::vector<std::vector<std::string>>& sources,
                                       const BoardSearch& search, const lf::SolveOptions& options,
                                       BoardRecordings& result) {
  lf::BoardFilms& films = result.films;
  if (result.clocks.empty() && search.reach > 0) {
    std::vector<CameraViews> all = search_all(
        rig, films.board, search.threads, "searching for the board: clocks",
        [&](BoardFinder& finder, size_t i, const auto& progress) { finder.add_video(sources[i][0], progress); });
    for (size_t i = 0; i < all.size(); i++)
      films.cameras[i].width = all[i].width, films.cameras[i].height = all[i].height;
    keep_films(all, films);
    result.clocks = lf::coarse_board_clocks(films, search.reach, options);
  }
  if (result.clocks.empty()) {
    result.clocks.resize(rig.cameras.size());
    for (lf::CameraClock& clock : result.clocks) clock.known = true;
  }
  for (const double stamp : instants_of(sources[0][0], search.instants))
    result.instants.push_back(result.clocks[0].true_time(stamp));
  std::vector<CameraViews> all = search_all(rig, films.board, search.threads, "searching for the board",
                                            [&](BoardFinder& finder, size_t i, const auto& progress) {
                                              if (!result.clocks[i].known) return;
                                              std::vector<double> stamps;
                                              for (const double instant : result.instants)
                                                stamps.push_back(result.clocks[i].stamp_of(instant));
                                              finder.add_video(sources[i][0], stamps, progress);
                                            });
  for (size_t i = 0; i < all.size(); i++)
    if (all[i].width > 0) films.cameras[i].width = all[i].width, films.cameras[i].height = all[i].height;
  return all;
}

}  // namespace

BoardRecordings detect_boards(const lf::Rig& rig, const std::string& folder, const lf::CalibrationBoard& board,
                              const BoardSearch& search, const lf::SolveOptions& options,
                              std::vector<lf::CameraClock> clocks) {
  check_folder(folder);
  std::vector<std::vector<std::string>> sources;
  bool has_pictures = false;
  BoardRecordings result;
  result.clocks = std::move(clocks);
  for (const lf::Camera& camera : rig.cameras) {
    sources.push_back(board_images(folder, camera));
    if (sources.back().empty())
      throw lf::Error(folder + " contains neither a video " + camera.name + ".* nor images in " + camera.name + "/");
    (lf::is_uri(sources.back()[0]) ? result.has_films : has_pictures) = true;
    result.films.cameras.push_back({camera.id, camera.width, camera.height});
  }
  if (result.has_films && has_pictures)
    throw lf::Error(folder +
                    " has videos of some cameras and pictures of others, so their instants cannot be compared");
  result.sightings.board = result.films.board = board;
  std::vector<CameraViews> all;
  if (result.has_films) {
    all = search_videos(rig, sources, search, options, result);
  } else {
    all = search_all(rig, board, search.threads, "searching for the board",
                     [&](BoardFinder& finder, size_t i, const auto& progress) {
                       for (size_t k = 0; k < sources[i].size(); k++) {
                         finder.add_picture(sources[i][k]);
                         progress(static_cast<double>(k + 1) / static_cast<double>(sources[i].size()));
                       }
                     });
    for (size_t i = 0; i < all.size(); i++)
      result.sightings.cameras.push_back({rig.cameras[i].id, all[i].width, all[i].height});
    add_pictures(all, result.sightings);
  }
  for (const CameraViews& camera : all) result.cameras.push_back(camera.counts);
  require_views(result, board);
  if (result.has_films) keep_films(all, result.films);
  return result;
}
