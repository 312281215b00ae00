// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"

#include <filesystem>
#include <map>
#include <regex>

#include "base/file.h"
#include "base/text.h"
#include "image/image_file.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

constexpr double kMaxExportError = 1e-6;  // pixels

using Place = std::pair<int, int>;  // row, column

struct NamedImage {
  std::string path;
  Vec2 position{0, 0};     // x, y from the file name
  double f_per_width = 0;  // focal length over image width; 0 if unknown
};

std::map<Place, NamedImage> read_names(const std::string& directory, std::vector<std::string>& notes) {
  static const std::regex kName(R"(.*?_(\d{1,5})_(\d{1,5})_(?:(-?\d+\.?\d*)_(-?\d+\.?\d*)_?|)"
                                R"((-?\d+\.\d+)_(-?\d+\.\d+)_(\d+\.?\d*)_(\d+\.?\d*))\.(png|jpg|jpeg))",
                                std::regex::icase);
  std::map<Place, NamedImage> images;
  constexpr size_t kLongestName = 255;  // std::regex is recursive
  size_t left_out = 0;
  for (const fs::path& path : paths_in(directory)) {
    const std::string name = path.filename().string();
    std::smatch parts;
    if (name.size() > kLongestName || !std::regex_match(name, parts, kName)) {
      left_out++;
      continue;
    }
    const auto number = [&](int part) { return number_of_text<double>(parts[part].str()).value_or(0); };
    const Place place(static_cast<int>(number(1)), static_cast<int>(number(2)));
    const bool has_lens = parts[7].matched;
    const int y = has_lens ? 5 : 3;
    NamedImage named{path.string(), {number(y + 1), number(y)}};
    if (has_lens) named.f_per_width = number(7) / number(8);
    if (has_lens && !(named.f_per_width > 0 && is_finite(named.f_per_width)))
      throw Error(path.string() + ": the focal length and the sensor width in the file name must be positive");
    const auto [other, is_new] = images.emplace(place, named);
    if (!is_new)
      throw Error(path.string() + ": remove or rename this file, because its name has the same row and column as " +
                  other->second.path);
  }
  if (images.empty())
    throw Error(directory +
                ": no file name has the form out_00_01_-381.9_-776.8.png, which contains the row, the column and the "
                "position (y, x) of the camera, and can also contain the focal length and the sensor width. For "
                "pictures with other names, estimate the positions with COLMAP, and import its result with lf-rig "
                "import colmap");
  if (images.size() > kMaxCameras)
    throw Error(directory + ": contains too many images; a rig has at most " + std::to_string(kMaxCameras) +
                " cameras");
  if (left_out > 0)
    notes.push_back(std::to_string(left_out) + " files in " + directory +
                    " have names of another form and were left out");
  return images;
}

void place_cameras(const std::vector<Vec2>& positions, const StanfordOptions& options, Rig& rig) {
  Vec2 middle(0, 0);
  for (const Vec2& position : positions) middle += position / static_cast<double>(positions.size());
  for (size_t i = 0; i < positions.size(); i++) {
    Camera& camera = rig.cameras[i];
    camera.pose = {Vec3(positions[i] * options.unit, 0), Quat(1, 0, 0, 0)};
    Vec2 centre((camera.width - 1) / 2.0, (camera.height - 1) / 2.0);
    if (options.focus_distance > 0)
      centre += (positions[i] - middle) * (options.unit * options.f / options.focus_distance);
    camera.lens = Lens::pinhole(options.f, centre.x, centre.y);
  }
}

// The archive's names have no exponents.
std::string fixed_text(double value) {
  char text[400];
  return {text, std::to_chars(text, text + sizeof(text), value, std::chars_format::fixed).ptr};
}

}  // namespace

double stanford_focal_length(const std::string& directory) {
  std::vector<std::string> ignored;
  const std::map<Place, NamedImage> images = read_names(directory, ignored);
  const NamedImage& first = images.begin()->second;
  for (const auto& [place, named] : images)
    if (named.f_per_width != first.f_per_width)
      throw Error(named.path + ": has another lens in its name than " + first.path);
  return first.f_per_width > 0 ? first.f_per_width * load_image_size(first.path).width : 0;
}

RigImport import_stanford(const std::string& directory, const StanfordOptions& options) {
  if (!(options.f > 0))
    throw Error("f: give the focal length in pixels (option --f), because the file names do not contain it");
  if (!(options.unit > 0)) throw Error("unit: must be positive");
  if (!(options.focus_distance >= 0)) throw Error("focus distance: must not be negative");
  RigImport result;
  Rig& rig = result.rig;
  std::vector<Vec2> positions;
  Place last(0, 0);
  for (const auto& [place, named] : read_names(directory, result.notes)) {
    last = {std::max(last.first, place.first), std::max(last.second, place.second)};
    result.has_unit = result.has_unit && named.f_per_width > 0;  // names with a lens are in millimetres
    const ImageSize size = load_image_size(named.path);
    Camera camera;
    camera.name = fs::path(named.path).stem().string();
    camera.image = fs::proximate(named.path).string();
    camera.width = size.width;
    camera.height = size.height;
    add_camera(camera, result);
    positions.push_back(named.position);
  }
  place_cameras(positions, options, rig);
  if (static_cast<size_t>(last.first + 1) * (last.second + 1) == rig.cameras.size())
    rig.topology = {Topology::Type::kGrid, last.first + 1, last.second + 1, {}};
  else
    result.notes.push_back("the images do not fill a grid, so the topology is Delaunay");
  if (options.focus_distance == 0) result.notes.push_back("the focus distance is 0: assuming unshifted images");
  return result;
}

RigExport export_stanford(const Rig& rig, const std::string& directory, double unit) {
  if (!(unit > 0)) throw Error("unit: must be positive");
  if (rig.topology.type != Topology::Type::kGrid)
    throw Error("the topology of the rig must be a grid, because the file names of the archive contain row and column");

  // In the coordinates of the first camera.
  Rig turned = rig;
  const Mat3 turn = glm::transpose(rig.cameras[0].pose.rotation());
  const double depth = (turn * rig.cameras[0].pose.position).z;
  std::vector<Vec2> positions, shifts;
  Vec2 mean_position(0, 0), mean_shift(0, 0);
  for (Camera& camera : turned.cameras) {
    if (camera.image.empty())
      throw_camera_error(camera, "has no image to be copied; lf-rig snapshot takes one still of each camera");
    const Vec3 position = turn * camera.pose.position;
    camera.pose = {position - Vec3(0, 0, depth), glm::normalize(glm::quat_cast(turn * camera.pose.rotation()))};
    positions.push_back(Vec2(position) / unit);
    shifts.push_back(Vec2(camera.lens.cx(), camera.lens.cy()));
    mean_position += Vec2(position) / static_cast<double>(rig.cameras.size());
    mean_shift += shifts.back() / static_cast<double>(rig.cameras.size());
  }
  double slope = 0, square = 0;  // slope of principal points over positions: f / focus distance
  for (size_t i = 0; i < positions.size(); i++) {
    const Vec2 position = positions[i] * unit - mean_position;
    slope += glm::dot(position, shifts[i] - mean_shift);
    square += glm::dot(position, position);
  }
  StanfordOptions options;
  options.unit = unit;
  options.f = rig.cameras[0].lens.fx();
  slope = square > 0 ? slope / square : 0;
  if (slope > 1e-12 * options.f) options.focus_distance = options.f / slope;
  Rig written = turned;
  place_cameras(positions, options, written);
  RigExport result = describe_grid_export(turned, written, kMaxExportError,
                                          "a flat array of equal pinhole cameras with the same direction");

  make_folder(directory);
  for (size_t i = 0; i < positions.size(); i++) {
    const fs::path from = rig.resolve(rig.cameras[i].image);
    const auto columns = static_cast<size_t>(rig.topology.columns);
    const fs::path to =
        fs::path(directory) / (format_text("out_%02zu_%02zu_", i / columns, i % columns) + fixed_text(positions[i].y) +
                               "_" + fixed_text(positions[i].x) + "_" + from.extension().string());
    copy_picture(rig, rig.cameras[i], to.string());
  }
  result.notes.push_back("lf-rig import stanford --f " + number_text(options.f) + " --focus-distance " +
                         number_text(options.focus_distance) + " --scale " + number_text(unit) + " reads it back");
  return result;
}

}  // namespace lf
