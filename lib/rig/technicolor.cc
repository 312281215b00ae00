// SPDX-License-Identifier: LGPL-2.1-or-later
#include <cmath>
#include <filesystem>
#include <map>
#include <regex>
#include <sstream>

#include "base/json_value.h"
#include "base/text.h"
#include "image/image_file.h"
#include "rig/exchange.h"
#include "rig/mesh.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

constexpr double kPixelCentre = 0.5;  // position of the centre of the top-left pixel
constexpr double kMostSkew = 1;       // pixels
constexpr size_t kColumns = 12;       // f cu cv ar sk qw qx qy qz tx ty tz
constexpr size_t kDistorted = 14;     // also d1 d2
constexpr int kRows = 4, kColumnsOfArray = 4;

// The picture files of a camera by frame number.
using Frames = std::map<int, fs::path>;

// Returns the frames of the cameras by camera number, from the files SCENE_FRAME_CAMERA.png of a folder.
std::map<int, Frames> find_frames(const std::string& directory) {
  static const std::regex kName(R"((.*)_(\d{1,9})_(\d{1,5})\.(png|jpg))", std::regex::icase);
  constexpr size_t kLongestName = 255;  // std::regex is recursive
  std::error_code ignored;
  const fs::path inner = fs::path(directory) / "images";
  std::map<int, Frames> cameras;
  for (const fs::path& path : paths_in(fs::is_directory(inner, ignored) ? inner.string() : directory)) {
    const std::string name = path.filename().string();
    std::smatch match;
    if (name.size() > kLongestName || !std::regex_match(name, match, kName)) continue;
    const auto [other, is_new] = cameras[std::stoi(match[3])].emplace(std::stoi(match[2]), path);
    if (!is_new)
      throw Error(path.string() + ": has the same frame and camera as " + other->second.string() +
                  "; keep the files of one scene in the folder");
  }
  return cameras;
}

// Sets the source or the image of a camera, and its size.
void take_pictures(const Frames& frames, Camera& camera) {
  const auto& [number, path] = *frames.begin();
  const ImageSize size = load_image_size(path.string());
  camera.width = size.width;
  camera.height = size.height;
  camera.image = fs::proximate(path).string();
  if (number > 1 || frames.size() == 1) return;
  const std::string name = camera.image;
  const size_t end = name.rfind('_'), begin = name.rfind('_', end - 1) + 1;
  if (name.find('%') != name.npos) return;
  camera.source = name.substr(0, begin) + "%0" + std::to_string(end - begin) + "d" + name.substr(end);
  camera.image.clear();
}

// Parses the numbers of a line. `place` is the file and the line.
std::vector<double> parse_line(const std::string& line, const std::string& place) {
  std::vector<double> numbers;
  std::istringstream words(line);
  for (std::string word; words >> word;) {
    const auto number = number_of_text<double>(word);
    if (!number || !is_finite(*number)) throw Error(place + ": \"" + word + "\" is not a finite number");
    numbers.push_back(*number);
  }
  if (numbers.size() == kDistorted)
    throw Error(place +
                ": describes distorted pictures (the columns d1 and d2), which can't be imported because the "
                "formula of the distortion is unknown; use the undistorted pictures of the set and their file");
  if (!numbers.empty() && numbers.size() != kColumns)
    throw Error(place + ": has " + std::to_string(numbers.size()) + " numbers, but needs " + std::to_string(kColumns) +
                " (f cu cv ar sk qw qx qy qz tx ty tz)");
  return numbers;
}

// Sets the lens and the pose of a camera. Returns how far the skew moves a point of the image, in pixels.
double parse_camera(const std::vector<double>& n, const std::string& place, Camera& camera) {
  const double f = n[0], aspect = n[3];
  if (!(f > 0 && aspect > 0)) throw Error(place + ": the focal length f and the aspect ratio ar must be positive");
  const Quat q(n[5], n[6], n[7], n[8]);
  const double norm = glm::length(q);
  constexpr double kTolerance = 1e-2;
  if (!(std::abs(norm - 1) < kTolerance))
    throw Error(place + ": qw qx qy qz must be a unit quaternion, but has the norm " + number_text(norm));
  try {
    camera.lens = Lens(LensModel::kPinhole, {f, f * aspect, n[1] - kPixelCentre, n[2] - kPixelCentre});
  } catch (const Error& e) {
    throw Error(place + ": " + e.what());
  }
  camera.pose = pose_of_camera_from_world({glm::mat3_cast(q / norm), {n[9], n[10], n[11]}});
  const double shift = std::abs(n[4]) * std::max(n[2], camera.height - n[2]) / (f * aspect);
  if (!(shift < kMostSkew))
    throw Error(place + ": the skew sk = " + number_text(n[4]) + " moves points by " + number_text(shift) +
                " px, and a rig cannot hold skew; " + kUndistortRemedy);
  return shift;
}

}  // namespace

RigImport import_technicolor(const std::string& directory) {
  const std::string path = (fs::path(directory) / "cameras_parameters.txt").string();
  const std::map<int, Frames> frames = find_frames(directory);
  RigImport result;
  result.has_unit = false;
  std::istringstream lines(read_text_file(path));
  std::string line;
  std::getline(lines, line);  // titles
  double skew = 0;
  bool is_single = false;
  for (int number = 2; std::getline(lines, line); number++) {
    const std::string place = path + ": line " + std::to_string(number);
    const std::vector<double> numbers = parse_line(line, place);
    if (numbers.empty()) continue;
    const int index = static_cast<int>(result.rig.cameras.size());
    const auto found = frames.find(index);
    if (found == frames.end())
      throw Error(place + ": the folder has no pictures of camera " + std::to_string(index) +
                  ", such as SCENE_undist_00001_" + format_text("%02d.png", index));
    Camera camera;
    camera.name = format_text("cam_%02d", index);
    take_pictures(found->second, camera);
    is_single = is_single || (found->second.size() > 1 && camera.source.empty());
    skew = std::max(skew, parse_camera(numbers, place, camera));
    add_camera(std::move(camera), result);
  }
  const std::string count = std::to_string(result.rig.cameras.size());
  if (result.rig.cameras.empty()) throw Error(path + ": has no cameras");
  if (frames.rbegin()->first >= static_cast<int>(result.rig.cameras.size()))
    throw Error(path + ": has " + count + " cameras, but the folder has pictures of camera " +
                std::to_string(frames.rbegin()->first));
  if (skew > 0) result.notes.push_back(format_text("skew was dropped, which moves points by up to %.2g px", skew));
  if (is_single)
    result.notes.push_back(
        "only the first picture of each camera is used: rename the files so that the frames have the numbers 0, 1, 2, "
        "... to show a film");
  if (result.rig.cameras.size() == kRows * kColumnsOfArray) {
    Rig grid = result.rig;
    grid.topology = {Topology::Type::kGrid, kRows, kColumnsOfArray, {}};
    if (!find_grid_fault(grid)) {
      result.rig = std::move(grid);
      return result;
    }
  }
  return with_topology(std::move(result));
}

}  // namespace lf
