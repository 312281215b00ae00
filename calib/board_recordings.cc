// SPDX-License-Identifier: LGPL-2.1-or-later
#include "board_recordings.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>

#include "base/text.h"
#include "board_options.h"
#include "image/image.h"
#include "recordings.h"

namespace {

constexpr double kFastest = 0.02;    // movement between two frames, relative to the image width
constexpr double kLongestGap = 0.2;  // seconds between two frames; the board may do anything in longer gaps
constexpr double kSameTime = 1e-3;   // seconds; a frame at this distance shows the instant
constexpr int kColumns = 8, kRows = 6;

struct CameraViews {
  BoardRecordings::Camera counts;
  int width = 0, height = 0;
  std::map<std::string, lf::BoardView> pictures;         // by the number in the name
  std::vector<std::pair<size_t, lf::BoardView>> frames;  // by instant
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

// Returns the view at `share` of the time between two frames. Returns nullopt if the board moves too fast.
std::optional<lf::BoardView> between(const lf::BoardView& a, const lf::BoardView& b, double share, int width) {
  lf::BoardView view;
  std::map<size_t, lf::Vec2> before;
  for (size_t i = 0; i < a.corners.size(); i++) before.emplace(a.id(i), a.corners[i]);
  double moved = 0;
  for (size_t i = 0; i < b.corners.size(); i++) {
    const auto found = before.find(b.id(i));
    if (found == before.end()) continue;
    view.ids.push_back(static_cast<int>(b.id(i)));
    view.corners.push_back(found->second + share * (b.corners[i] - found->second));
    moved += glm::length(b.corners[i] - found->second);
  }
  if (view.ids.empty() || moved > kFastest * width * static_cast<double>(view.ids.size())) return std::nullopt;
  return view;
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

  // `instants` are increasing, in seconds.
  void add_video(const std::string& uri, const std::vector<double>& instants,
                 const std::function<void(double)>& progress) {
    std::optional<lf::Image> before;
    double before_time = 0;
    size_t next = 0;
    for_each_video_frame(uri, VideoFormat::kRgb, [&](const VideoFrame& frame) {
      check_size(frame.width, frame.height, uri);
      lf::Image image = frame.rgb();
      for (; next < instants.size() && instants[next] <= frame.time + kSameTime; next++) {
        auto view = std::abs(instants[next] - frame.time) <= kSameTime ? find(image)
                    : before && frame.time - before_time < kLongestGap
                        ? find_between(*before, image, (instants[next] - before_time) / (frame.time - before_time))
                        : std::nullopt;
        if (!view) continue;
        view->name = lf::format_text("%s at %.3f s", uri.c_str(), instants[next]);
        found_.frames.emplace_back(next, std::move(*view));
        found_.counts.views++;
      }
      before = std::move(image);
      before_time = frame.time;
      progress(frame.progress);
      return next < instants.size();
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
    for (const auto& [instant, view] : found_.frames) cover(view);
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

  std::optional<lf::BoardView> find_between(const lf::Image& a, const lf::Image& b, double share) {
    const auto first = find(a);
    const auto second = first ? find(b) : std::nullopt;
    if (!second) return std::nullopt;
    found_.counts.pictures--;
    return between(*first, *second, share, a.width());
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
void number_pictures(std::vector<CameraViews>& cameras) {
  const auto natural = [](std::string_view a, std::string_view b) { return lf::natural_less(a, b); };
  std::map<std::string, size_t, decltype(natural)> numbers(natural);
  for (const CameraViews& camera : cameras)
    for (const auto& [key, view] : camera.pictures) numbers.emplace(key, 0);
  size_t next = 0;
  for (auto& [key, instant] : numbers) instant = next++;
  for (CameraViews& camera : cameras)
    for (auto& [key, view] : camera.pictures) camera.frames.emplace_back(numbers[key], std::move(view));
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

}  // namespace

BoardRecordings detect_boards(const lf::Rig& rig, const std::string& folder, const lf::CalibrationBoard& board,
                              int instants, int threads) {
  check_folder(folder);
  std::vector<std::vector<std::string>> sources;
  size_t videos = 0, with_pictures = 0;
  for (const lf::Camera& camera : rig.cameras) {
    sources.push_back(board_images(folder, camera));
    if (sources.back().empty())
      throw lf::Error(folder + " contains neither a video " + camera.name + ".* nor images in " + camera.name + "/");
    (lf::is_uri(sources.back()[0]) ? videos : with_pictures)++;
  }
  if (videos > 0 && with_pictures > 0)
    throw lf::Error(folder +
                    " has videos of some cameras and pictures of others, so their instants cannot be compared");
  std::vector<double> times;
  if (videos > 0) times = instants_of(sources[0][0], instants);

  std::vector<CameraViews> all(rig.cameras.size());
  for_each_recording("searching for the board", all.size(), threads, [&](size_t i, const auto& progress) {
    BoardFinder finder(rig.cameras[i], board);
    if (videos > 0) {
      finder.add_video(sources[i][0], times, progress);
    } else {
      for (size_t k = 0; k < sources[i].size(); k++) {
        finder.add_picture(sources[i][k]);
        progress(static_cast<double>(k + 1) / static_cast<double>(sources[i].size()));
      }
    }
    all[i] = finder.finish();
  });

  number_pictures(all);
  BoardRecordings result;
  result.sightings.board = board;
  for (uint32_t i = 0; i < all.size(); i++) {
    result.cameras.push_back(all[i].counts);
    result.sightings.cameras.push_back({rig.cameras[i].id, all[i].width, all[i].height});
    for (auto& [instant, view] : all[i].frames) {
      result.sightings.num_instants = std::max(result.sightings.num_instants, instant + 1);
      result.sightings.sightings.push_back({i, static_cast<uint32_t>(instant), std::move(view)});
    }
  }
  require_views(result, board);
  return result;
}
