// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <cctype>
#include <iterator>
#include <map>
#include <set>

#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "base/text.h"
#include "rig/exchange.h"

namespace lf {
namespace {

using nlohmann::json;

constexpr char kSpaces[] = " \t\r";

// Reads a subset of TOML: tables with plain keys, and values that are numbers, strings, booleans or (nested) arrays on
// one or several lines. YAML has the same syntax for such values.
class TomlReader {
 public:
  TomlReader(const std::string& text, const std::string& name) : text_(text), name_(name) {}

  json read() {
    json root = json::object();
    json* table = &root;
    while (skip_to_token()) {
      if (text_[at_] == '[') {
        table = &open_table(root);
      } else {
        const std::string key = read_key('=');
        if (table->contains(key)) fail("\"" + key + "\" occurs twice; remove one of the two lines");
        (*table)[key] = read_value();
      }
      skip_spaces();
      if (at_ < text_.size() && text_[at_] != '\n' && text_[at_] != '#') fail("has text after the value");
    }
    return root;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw Error(name_ + ": line " + std::to_string(line_ + 1) + ": " + what);
  }
  void skip_spaces() { at_ = std::min(text_.find_first_not_of(kSpaces, at_), text_.size()); }
  // Skips empty lines and comments. Returns false at the end of the text.
  bool skip_to_token() {
    for (skip_spaces(); at_ < text_.size() && (text_[at_] == '\n' || text_[at_] == '#'); skip_spaces()) {
      at_ = std::min(text_.find('\n', at_), text_.size());
      if (at_ < text_.size()) at_++, line_++;
    }
    return at_ < text_.size();
  }
  // Reads a plain key and the character `end`, which follows the key.
  std::string read_key(char end) {
    skip_spaces();
    const size_t begin = at_;
    const auto is_plain = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-'; };
    while (at_ < text_.size() && is_plain(text_[at_])) at_++;
    const std::string key = text_.substr(begin, at_ - begin);
    skip_spaces();
    if (key.empty() || at_ >= text_.size() || text_[at_] != end)
      fail(std::string("must be \"[table]\" or \"key = value\", with keys of letters, digits, _ and -"));
    at_++;
    return key;
  }
  json& open_table(json& root) {
    const size_t end = text_.find_first_of("]\n", at_);
    json* table = &root;
    for (at_++; end != text_.npos;) {
      const bool is_last = text_.find('.', at_) > end;
      const std::string key = read_key(is_last ? ']' : '.');
      if (is_last && table->contains(key)) fail("the table \"" + key + "\" occurs twice; remove one of the two tables");
      table = &(*table)[key];
      if (!table->is_null() && !table->is_object()) fail("\"" + key + "\" is both a table and a value");
      if (is_last && table->is_null()) *table = json::object();
      if (is_last) return *table;
    }
    fail("the bracket ] is missing");
  }
  json read_value() {
    const size_t begin = at_, first_line = line_;
    int depth = 0;
    char quote = 0;
    bool is_comment = false;
    for (; at_ < text_.size(); at_++) {
      const char c = text_[at_];
      const bool was_inside = quote || depth > 0;
      if (c == '\n') {
        if (depth == 0) break;
        line_++;
        is_comment = false;
      } else if (quote) {
        if (c == '\\' && quote == '"')
          at_++;
        else if (c == quote)
          quote = 0;
      } else if (!is_comment) {
        if (c == '"' || c == '\'') quote = c;
        if (c == '#' && depth == 0) break;
        is_comment = c == '#';
        depth += (c == '[') - (c == ']');
      }
      if (was_inside && !quote && depth <= 0) {  // the end of a string or array
        at_++;
        break;
      }
    }
    at_ = std::min(at_, text_.size());
    // The empty lines keep the line numbers of errors the same as in the file.
    json value = parse_yaml(std::string(first_line, '\n') + text_.substr(begin, at_ - begin), name_, "TOML");
    if (value.is_null()) fail("the value is missing");
    return value;
  }

  const std::string& text_;
  const std::string& name_;
  size_t at_ = 0, line_ = 0;
};

const std::set<std::string_view> kKnownKeys = {
    // Keys that the importer reads.
    "cam_id", "port", "size", "matrix", "distortions", "rotation", "translation", "ignore", "fisheye",
    // Keys without effect on a rig. Caliscope's rotation_count only turns the pictures of its window.
    "rotation_count", "error", "exposure", "grid_count", "verified_resolutions"};

// Returns the 9 numbers of [[...], [...], [...]], row by row.
std::vector<double> parse_matrix(const JsonValue& value) {
  std::vector<double> matrix;
  for (const JsonValue& row : value.elements(3)) std::ranges::copy(parse_numbers(row, 3), std::back_inserter(matrix));
  return matrix;
}

Lens parse_caliscope_lens(const JsonValue& camera) {
  const JsonValue place = camera.at("matrix");
  const auto pinhole = pinhole_of_matrix(parse_matrix(place));
  if (!pinhole) place.fail("must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], because a rig cannot hold skew");
  const auto fisheye = camera.find("fisheye");
  const bool is_fisheye = fisheye && fisheye->flag();
  std::vector<double> distortion;
  if (const auto terms = camera.find("distortions")) {
    distortion = parse_numbers(*terms);
    if (distortion.size() != 4 && (is_fisheye || distortion.size() != 5))
      terms->fail(is_fisheye ? "must be [k1, k2, k3, k4]" : "must be [k1, k2, p1, p2, k3]");
  }
  return lens_from_opencv(place, *pinhole, distortion, is_fisheye);
}

// The rotation is a matrix in files of older versions.
RigidTransform parse_pose(const JsonValue& camera, bool is_matrix) {
  RigidTransform camera_from_world;
  const JsonValue rotation = camera.at("rotation");
  if (is_matrix) {
    camera_from_world.rotation = nearest_rotation(matrix_of_rows(parse_matrix(rotation)), rotation);
  } else {
    camera_from_world.rotation = rotation_from_vector(rotation.vec3());
  }
  camera_from_world.translation = camera.at("translation").vec3();
  return camera_from_world;
}

// Caliscope writes "null" for unknown values. If the videos are undistorted, distortion terms have no effect.
void remove_unused(json& cameras, bool undistorted) {
  for (json& camera : cameras) {
    if (!camera.is_object()) continue;
    if (undistorted) {
      camera.erase("distortions");
      camera.erase("fisheye");
    }
    for (auto it = camera.begin(); it != camera.end();) it = *it == "null" ? camera.erase(it) : std::next(it);
  }
}

RigImport parse_caliscope(const std::string& text, const std::string& path, bool undistorted) {
  json root = TomlReader(text, path).read();
  if (root.contains("cameras")) remove_unused(root["cameras"], undistorted);
  const JsonValue file(root, path), cameras = file.at("cameras");
  std::set<std::string_view> known = kKnownKeys;
  known.insert("cameras");
  std::map<uint32_t, std::string> keys;  // by id
  for (const auto& [key, value] : root["cameras"].items()) {
    const auto id = number_of_text<uint32_t>(key);
    if (!id || !keys.emplace(*id, key).second)
      cameras.fail("the table \"" + key + "\" must have the number of a camera, and each camera its own number");
    known.insert(key);
  }
  RigImport result;
  result.notes = check_foreign_keys(root, path, known, {"fisheye"});
  std::string without_pose, ignored;
  for (const auto& [id, key] : keys) {
    const JsonValue value = cameras.at(key.c_str());
    if (const auto ignore = value.find("ignore"); ignore && ignore->flag()) {
      ignored += (ignored.empty() ? "" : ", ") + key;
      continue;
    }
    if (!value.find("rotation") && !value.find("translation")) {
      without_pose += (without_pose.empty() ? "" : ", ") + key;
      continue;
    }
    Camera camera;
    camera.id = id;
    camera.name = "cam_" + key;
    parse_image_size(value.at("size"), camera);
    camera.lens = parse_caliscope_lens(value);
    const json rotation = root["cameras"][key].value("rotation", json());
    camera.pose = pose_of_camera_from_world(
        parse_pose(value, rotation.is_array() && !rotation.empty() && rotation[0].is_array()));
    result.rig.cameras.push_back(camera);
  }
  if (!ignored.empty()) result.notes.push_back("cameras that Caliscope ignores were left out: " + ignored);
  if (!without_pose.empty()) result.notes.push_back("cameras without a pose were left out: " + without_pose);
  if (result.rig.cameras.empty())
    cameras.fail("no camera has rotation and translation; calibrate the extrinsics in Caliscope first");
  if (result.rig.cameras.size() > kMaxCameras)
    cameras.fail("has too many cameras; a rig has at most " + std::to_string(kMaxCameras) + " cameras");
  return result;
}

std::string caliscope_text(const Rig& rig) {
  std::string text;
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    const Camera& camera = rig.cameras[i];
    const Lens& lens = camera.lens;
    const bool fisheye = lens.distortion().fisheye;
    if (lens.distortion().is_rational) throw_camera_error(camera, "Caliscope cannot hold the terms k4, k5 and k6");
    std::vector<double> terms = opencv_terms(camera);
    terms.resize(fisheye ? 4 : 5);
    const RigidTransform motion = camera_from_world(camera.pose);
    const Vec3 rotation = vector_from_rotation(motion.rotation), &translation = motion.translation;
    text += "[cameras." + std::to_string(i) + "]\ncam_id = " + std::to_string(i) + "\nsize = [" +
            std::to_string(camera.width) + ", " + std::to_string(camera.height) + "]\nrotation_count = 0\nmatrix = [" +
            number_list_text(std::array{lens.fx(), 0.0, lens.cx()}) + ", " +
            number_list_text(std::array{0.0, lens.fy(), lens.cy()}) +
            ", [0.0, 0.0, 1.0]]\ndistortions = " + number_list_text(terms) +
            "\ntranslation = " + number_list_text({&translation.x, 3}) +
            "\nrotation = " + number_list_text({&rotation.x, 3}) + "\nfisheye = " + (fisheye ? "true" : "false") +
            "\n\n";
  }
  return text;
}

}  // namespace

RigImport import_caliscope(const std::string& path, bool undistorted) {
  return with_topology(parse_caliscope(read_text_file(path), path, undistorted));
}

RigExport export_caliscope(const Rig& rig, const std::string& path) {
  const std::string text = caliscope_text(rig);
  const RigExport result =
      describe_export(rig, parse_caliscope(text, path, false).rig, {.images = false, .names = false, .ids = false});
  write_text_file(text, path);
  return result;
}

}  // namespace lf
