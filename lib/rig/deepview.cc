// SPDX-License-Identifier: LGPL-2.1-or-later
#include <cmath>
#include <filesystem>
#include <set>

#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "base/text.h"
#include "rig/exchange.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

const std::set<std::string_view> kKnownKeys = {
    "name",   "position", "orientation",       "focal_length",   "pixel_aspect_ratio", "principal_point",
    "height", "width",    "radial_distortion", "projection_type"};

Camera parse_camera(const JsonValue& value, const fs::path& folder) {
  Camera camera;
  camera.name = value.at("name").name();
  const JsonValue type = value.at("projection_type"), aspect = value.at("pixel_aspect_ratio");
  if (type.text() != "fisheye") type.fail("must be \"fisheye\", but is \"" + type.text() + "\"");
  if (aspect.number() != 1) aspect.fail("must be 1, but is " + number_text(aspect.number()));
  parse_image_size(value.at("width"), value.at("height"), camera);
  const JsonValue distortion = value.at("radial_distortion"), focal = value.at("focal_length");
  const std::vector<double> k = parse_numbers(distortion, 3), centre = parse_numbers(value.at("principal_point"), 2);
  if (k[2] != 0) distortion.fail("must have the third term 0, but it is " + number_text(k[2]));
  const double f = focal.number();
  camera.lens = lens_from_opencv(focal, {f, f, centre[0], centre[1]}, {k[0], k[1], 0, 0}, true);
  const Mat3 rotation = rotation_from_vector(value.at("orientation").vec3());
  camera.pose = {value.at("position").vec3(), glm::normalize(glm::quat_cast(glm::transpose(rotation)))};
  const fs::path film = folder / (camera.name + ".mp4");
  if (std::error_code ignored; camera.name.find('/') == std::string::npos && fs::is_regular_file(film, ignored))
    camera.source = fs::proximate(film).string();
  return camera;
}

}  // namespace

RigImport import_deepview(const std::string& path) {
  const nlohmann::json root = parse_json(read_text_file(path), path);
  const JsonValue file(root, path);
  const std::vector<JsonValue> views = file.elements();
  if (views.empty() || views.size() > kMaxCameras)
    throw Error(path + ": must have 1 to " + std::to_string(kMaxCameras) + " cameras, but has " +
                std::to_string(views.size()));
  RigImport result;
  result.has_unit = false;
  result.notes = check_foreign_keys(root, path, kKnownKeys);
  std::set<std::string> names;
  size_t films = 0;
  for (const JsonValue& view : views) {
    Camera camera = parse_camera(view, fs::path(path).parent_path());
    if (!names.insert(camera.name).second) view.at("name").fail("is the name of two cameras");
    films += !camera.source.empty();
    add_camera(std::move(camera), result);
  }
  if (films > 0 && films < views.size())
    result.notes.push_back(std::to_string(views.size() - films) + " of " + std::to_string(views.size()) +
                           " cameras have no film NAME.mp4 beside the file");
  return with_topology(std::move(result));
}

}  // namespace lf
