// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <filesystem>
#include <set>
#include <sstream>

#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/json_value.h"
#include "base/text.h"
#include "image/image_file.h"
#include "rig/exchange.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

std::string trimmed(const std::string& text) {
  constexpr char kSpaces[] = " \t\r";
  const size_t begin = text.find_first_not_of(kSpaces);
  return begin == text.npos ? "" : text.substr(begin, text.find_last_not_of(kSpaces) + 1 - begin);
}

// Converts an INI file to JSON, {"section": {"key": value}}. Values that are numeric become numbers. Throws Error with
// the line.
nlohmann::json parse_ini(const std::string& text, const std::string& name) {
  nlohmann::json root = nlohmann::json::object();
  nlohmann::json* section = nullptr;
  std::istringstream lines(text);
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    const auto fail = [&](const std::string& what) {
      throw Error(name + ": line " + std::to_string(number) + ": " + what);
    };
    number++;
    line = trimmed(line);
    if (line.empty() || line[0] == '#' || line[0] == ';') continue;
    if (!is_utf8(line)) fail("the text is not UTF-8");
    if (line[0] == '[' && line.back() == ']') {
      const std::string title = line.substr(1, line.size() - 2);
      if (root.contains(title)) fail("the section \"" + title + "\" occurs twice; remove one of the two sections");
      section = &(root[title] = nlohmann::json::object());
      continue;
    }
    const size_t equals = line.find('=');
    if (equals == line.npos || !section) fail("must be \"[section]\", or \"key = value\" in a section");
    const std::string key = trimmed(line.substr(0, equals)), value = trimmed(line.substr(equals + 1));
    if (section->contains(key)) fail("\"" + key + "\" occurs twice; remove one of the two lines");
    const auto real = number_of_text<double>(value);
    (*section)[key] = real && is_finite(*real) ? nlohmann::json(*real) : nlohmann::json(value);
  }
  return root;
}

double positive(const JsonValue& section, const char* key) {
  const double number = section.at(key).number();
  if (!(number > 0)) section.at(key).fail("must be positive, is " + number_text(number));
  return number;
}

const std::set<std::string_view> kKnownKeys = {
    // Keys that the importer reads.
    "intrinsics", "extrinsics", "meta", "focal_length_mm", "sensor_size_mm", "image_resolution_x_px",
    "image_resolution_y_px", "num_cams_x", "num_cams_y", "baseline_mm", "focus_distance_m", "center_cam_x_m",
    "center_cam_y_m", "center_cam_z_m", "center_cam_rx_rad", "center_cam_ry_rad", "center_cam_rz_rad", "disp_min",
    "disp_max",
    // Keys without effect on a rig. "offset" follows from the keys above.
    "fstop", "offset", "scene", "category", "date", "version", "authors", "contact", "cycles_seed", "frustum_disp_min",
    "frustum_disp_max", "depth_map_scale"};

std::string image_path(const fs::path& directory, size_t index) {
  return (directory / format_text("input_Cam%03zu.png", index)).string();
}

// The pose of the middle of the array. Files of unplaced arrays have no keys "center_cam_...".
Pose parse_middle(const JsonValue& extrinsics, std::vector<std::string>& notes) {
  if (!extrinsics.find("center_cam_x_m")) {
    notes.push_back("center_cam_x_m is missing: the middle of the array is at the origin of the world");
    return {};
  }
  const auto vector = [&](const char* x, const char* y, const char* z) {
    return Vec3(extrinsics.at(x).number(), extrinsics.at(y).number(), extrinsics.at(z).number());
  };
  const auto ours = [](const Vec3& blender) { return Vec3(blender.x, -blender.z, blender.y); };
  const Mat3 axes = rotation_from_euler(vector("center_cam_rx_rad", "center_cam_ry_rad", "center_cam_rz_rad"));
  return pose_of_world_from_camera({Mat3(ours(axes[0]), ours(-axes[1]), ours(-axes[2])),
                                    ours(vector("center_cam_x_m", "center_cam_y_m", "center_cam_z_m"))});
}

// `scale` is the focal length in pixels times the baseline in metres. A point at depth z has the disparity
// scale (1 / z - 1 / focus distance).
void read_depths(const JsonValue& file, double scale, double focus_distance, RigImport& import) {
  const auto meta = file.find("meta");
  if (!meta || !meta->find("disp_min") || !meta->find("disp_max")) return;
  const auto inverse = [&](const char* key) {
    return meta->at(key).number() / scale + (focus_distance > 0 ? 1 / focus_distance : 0);
  };
  const double nearest = inverse("disp_max"), farthest = inverse("disp_min");
  if (!(nearest > farthest && nearest > 0)) return;
  import.near = 1 / nearest;
  if (farthest > 0) import.far = 1 / farthest;
}

// Does not read the images.
RigImport parse_hci(const std::string& text, const std::string& path) {
  const nlohmann::json root = parse_ini(text, path);
  const JsonValue file(root, path), intrinsics = file.at("intrinsics"), extrinsics = file.at("extrinsics");
  Camera camera;
  parse_image_size(intrinsics.at("image_resolution_x_px"), intrinsics.at("image_resolution_y_px"), camera);
  const int width = camera.width, height = camera.height;
  const double f =
      positive(intrinsics, "focal_length_mm") / positive(intrinsics, "sensor_size_mm") * std::max(width, height);
  if (!is_finite(f)) intrinsics.at("sensor_size_mm").fail("is too small for the focal length");
  const int columns = static_cast<int>(extrinsics.at("num_cams_x").integer(1, kMaxCameras));
  const int rows = static_cast<int>(extrinsics.at("num_cams_y").integer(1, kMaxCameras / columns));
  const double baseline = positive(extrinsics, "baseline_mm") / 1000;
  const double focus_distance = extrinsics.at("focus_distance_m").number();
  if (!(focus_distance >= 0)) extrinsics.at("focus_distance_m").fail("must not be negative (0 means infinity)");
  // The disparity between neighbouring images of a point at infinity, in pixels.
  const double step = focus_distance > 0 ? f * baseline / focus_distance : 0;
  if (!(step < kMaxImageSize))
    extrinsics.at("focus_distance_m").fail("shifts neighbouring images by " + number_text(step) + " pixels");

  RigImport result;
  result.notes = check_foreign_keys(root, path, kKnownKeys);
  const Pose middle = parse_middle(extrinsics, result.notes);
  for (int row = 0; row < rows; row++)
    for (int column = 0; column < columns; column++) {
      const std::string image = image_path(fs::path(path).parent_path(), result.rig.cameras.size());
      camera.name = fs::path(image).stem().string();
      camera.image = fs::proximate(image).string();
      const Vec2 place(column - (columns - 1) / 2.0, row - (rows - 1) / 2.0);
      camera.lens = Lens::pinhole(f, (width - 1) / 2.0 + place.x * step, (height - 1) / 2.0 + place.y * step);
      camera.pose = {middle.world_from_camera(Vec3(place * baseline, 0)), middle.orientation};
      add_camera(camera, result);
    }
  result.rig.topology = {Topology::Type::kGrid, rows, columns, {}};
  read_depths(file, f * baseline, focus_distance, result);
  return result;
}

// Returns parameters.cfg for a grid of equal cameras. The distances of the first cameras are those of all cameras.
std::string hci_text(const Rig& rig) {
  const Camera &first = rig.cameras[0], &next = rig.cameras[rig.cameras.size() > 1];
  const int columns = rig.topology.columns;
  const Vec3 step = first.pose.camera_from_world(next.pose.position);
  const double baseline = rig.cameras.size() > 1 ? (columns > 1 ? step.x : step.y) : 1;
  const double shift = columns > 1 ? next.lens.cx() - first.lens.cx() : next.lens.cy() - first.lens.cy();
  const double focus_distance = shift > 1e-12 * first.lens.fx() ? first.lens.fx() * baseline / shift : 0;
  Vec3 middle(0, 0, 0);
  for (const Camera& camera : rig.cameras)
    middle += (camera.pose.position - first.pose.position) / static_cast<double>(rig.cameras.size());
  const auto blender = [](const Vec3& ours) { return Vec3(ours.x, ours.z, -ours.y); };
  const Vec3 centre = blender(first.pose.position + middle);
  const Vec3 angles = euler_from_rotation(
      Mat3(blender(first.pose.right()), -blender(first.pose.down()), -blender(first.pose.forward())));
  std::string text;
  const auto line = [&](const std::string& key, double value) { text += key + " = " + number_text(value) + "\n"; };
  text += "[intrinsics]\n";
  line("focal_length_mm", first.lens.fx());  // a pixel is 1 mm
  line("sensor_size_mm", std::max(first.width, first.height));
  line("image_resolution_x_px", first.width);
  line("image_resolution_y_px", first.height);
  text += "\n[extrinsics]\n";
  line("num_cams_x", columns);
  line("num_cams_y", rig.topology.rows);
  line("baseline_mm", baseline * 1000);
  line("focus_distance_m", focus_distance);
  for (int i = 0; i < 3; i++) {
    const std::string axis(1, "xyz"[i]);
    line("center_cam_" + axis + "_m", centre[i]);
    line("center_cam_r" + axis + "_rad", angles[i]);
  }
  return text;
}

}  // namespace

RigImport import_hci(const std::string& directory) {
  const std::string path = (fs::path(directory) / "parameters.cfg").string();
  RigImport result = parse_hci(read_text_file(path), path);
  for (const Camera& camera : result.rig.cameras) {
    const std::string image = image_path(directory, camera.id);
    if (const ImageSize size = load_image_size(image); size != ImageSize{camera.width, camera.height})
      throw Error(image + ": is " + size_text(size.width, size.height) + ", but " + path + " states " +
                  size_text(camera.width, camera.height));
  }
  return result;
}

RigExport export_hci(const Rig& rig, const std::string& directory) {
  constexpr double kMaxError = 1e-3;  // pixels
  if (rig.topology.type != Topology::Type::kGrid)
    throw Error("the topology of the rig must be a grid, because the format has rows and columns of cameras");
  for (const Camera& camera : rig.cameras)
    if (fs::path(camera.image).extension() != ".png") throw_camera_error(camera, "its image must be a PNG file");
  const std::string path = (fs::path(directory) / "parameters.cfg").string(), text = hci_text(rig);
  const RigExport result =
      describe_grid_export(rig, parse_hci(text, path).rig, kMaxError,
                           "a flat grid of equal pinhole cameras with the same direction and equal distances");
  make_folder(directory);
  for (size_t i = 0; i < rig.cameras.size(); i++) copy_picture(rig, rig.cameras[i], image_path(directory, i));
  write_text_file(text, path);
  return result;
}

}  // namespace lf
