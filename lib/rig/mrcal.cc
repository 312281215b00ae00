// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <set>

#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/json_value.h"
#include "base/text.h"
#include "rig/exchange.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

constexpr char kEnding[] = ".cameramodel";

// A file is a dictionary of Python. Without the b of its byte strings, this is a flow mapping of YAML.
nlohmann::json parse_dictionary(const std::string& text, const std::string& path) {
  std::string yaml;
  char quote = 0;  // the quotation mark that ends the current string
  bool is_comment = false, has_ended = false;
  int depth = 0, line = 1;
  for (size_t i = 0; i < text.size(); i++) {
    const char c = text[i], next = i + 1 < text.size() ? text[i + 1] : '\0';
    line += c == '\n';
    if (is_comment) {
      is_comment = c != '\n';
    } else if (quote) {
      if (c == quote) quote = 0;
    } else if (c == '#') {
      is_comment = true;
      yaml += ' ';  // YAML requires a space before the comment
    } else {
      if (has_ended && !std::isspace(static_cast<unsigned char>(c)))
        throw Error(path + ": line " + std::to_string(line) + ": has text after the dictionary");
      if (c == 'b' && (next == '\'' || next == '"')) continue;
      if (c == '\'' || c == '"') quote = c;
      depth += (c == '{' || c == '[') - (c == '}' || c == ']');
      has_ended |= depth == 0 && c == '}';
    }
    yaml += c;
  }
  return parse_yaml(yaml, path, "Python");
}

const std::set<std::string_view> kKnownKeys = {
    // Keys that the importer reads.
    "lens_model", "lensmodel", "intrinsics", "extrinsics", "rt_cam_ref", "imagersize",
    // Keys without effect on a rig.
    "valid_intrinsics_region", "optimization_inputs", "icam_intrinsics", "covariance_intrinsics"};

Lens parse_mrcal_lens(const JsonValue& file) {
  const JsonValue model = file.find("lensmodel") ? file.at("lensmodel") : file.at("lens_model");
  const std::string name = model.text();
  const std::pair<const char*, size_t> models[] = {{"LENSMODEL_PINHOLE", 4},
                                                   {"LENSMODEL_OPENCV4", 8},
                                                   {"LENSMODEL_OPENCV5", 9},
                                                   {"LENSMODEL_OPENCV8", 12},
                                                   {"LENSMODEL_OPENCV12", 16}};
  const std::string remedy =
      "; calibrate with LENSMODEL_OPENCV8, convert the model with mrcal-convert-lensmodel --sampled LENSMODEL_OPENCV8, "
      "or the pictures with mrcal-reproject-image --to-pinhole";
  const auto* const found = std::ranges::find(models, name, [](const auto& known) { return std::string(known.first); });
  if (found == std::end(models)) model.fail("a rig cannot hold the lens model \"" + name + "\"" + remedy);
  const JsonValue place = file.at("intrinsics");
  const std::vector<double> k = parse_numbers(place, found->second);
  return lens_from_opencv(place, {k[0], k[1], k[2], k[3]}, {k.begin() + 4, k.end()}, false, remedy);
}

Camera parse_camera(const std::string& path, std::vector<std::string>& notes) {
  nlohmann::json root = parse_dictionary(read_text_file(path), path);
  const JsonValue file(root, path);
  Camera camera;
  camera.name = fs::path(path).stem().string();
  parse_image_size(file.at("imagersize"), camera);
  camera.lens = parse_mrcal_lens(file);
  const JsonValue place = file.find("rt_cam_ref") ? file.at("rt_cam_ref") : file.at("extrinsics");
  const std::vector<double> rt = parse_numbers(place, 6);
  camera.pose = pose_of_camera_from_world({rotation_from_vector({rt[0], rt[1], rt[2]}), {rt[3], rt[4], rt[5]}});
  root.erase("lens_model");  // check_foreign_keys() does not know mrcal's names of lens models
  for (const std::string& note : check_foreign_keys(root, path, kKnownKeys)) notes.push_back(path + ": " + note);
  return camera;
}

std::string mrcal_text(const Camera& camera) {
  const Lens& lens = camera.lens;
  if (lens.distortion().fisheye) throw_camera_error(camera, "mrcal cannot hold OpenCV's fisheye lenses");
  std::vector<double> intrinsics = {lens.fx(), lens.fy(), lens.cx(), lens.cy()}, terms = opencv_terms(camera);
  if (terms.size() > 4 && !lens.distortion().is_rational) terms.resize(5);
  intrinsics.insert(intrinsics.end(), terms.begin(), terms.end());
  const RigidTransform motion = camera_from_world(camera.pose);
  const Vec3 r = vector_from_rotation(motion.rotation), &t = motion.translation;
  return "{\n    'lens_model':  'LENSMODEL_OPENCV" + std::to_string(terms.size()) +
         "',\n    'intrinsics':  " + number_list_text(intrinsics) +
         ",\n    'extrinsics':  " + number_list_text(std::array{r.x, r.y, r.z, t.x, t.y, t.z}) +
         ",\n    'imagersize':  [" + std::to_string(camera.width) + ", " + std::to_string(camera.height) + "],\n}\n";
}

}  // namespace

RigImport import_mrcal(const std::string& path) {
  std::vector<std::string> paths;
  std::error_code error;
  if (fs::is_directory(path, error)) {
    for (const fs::path& file : paths_in(path))
      if (file.extension() == kEnding) paths.push_back(file.string());
    if (paths.empty()) throw Error(path + ": contains no file *.cameramodel");
    if (paths.size() > kMaxCameras)
      throw Error(path + ": has too many files; a rig has at most " + std::to_string(kMaxCameras) + " cameras");
  } else {
    paths.push_back(path);
  }
  RigImport result;
  for (const std::string& file : paths) add_camera(parse_camera(file, result.notes), result);
  return with_topology(std::move(result));
}

RigExport export_mrcal(const Rig& rig, const std::string& directory) {
  const std::vector<std::string> names = file_names_of(
      rig, [](const Camera&) { return std::string(kEnding); }, natural_less);
  std::vector<std::string> texts;
  for (const Camera& camera : rig.cameras) texts.push_back(mrcal_text(camera));
  make_folder(directory);
  for (size_t i = 0; i < names.size(); i++) write_text_file(texts[i], (fs::path(directory) / names[i]).string());
  const bool has_names = names[0] == rig.cameras[0].name + kEnding;
  const Rig written = import_mrcal(directory).rig;
  if (written.cameras.size() != names.size())
    throw Error(directory + ": contains .cameramodel files of other cameras; give another folder");
  return describe_export(rig, written, {.images = false, .names = has_names, .ids = false});
}

}  // namespace lf
