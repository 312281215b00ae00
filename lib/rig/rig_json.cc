// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/rig_json.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <string_view>
#include <unordered_map>

#include <sys/stat.h>
#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/json_value.h"
#include "base/text.h"
#include "geometry/lens.h"
#include "rig/source_security.h"

namespace lf {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr char kRigFormat[] = "lightfield-rig";
constexpr int kRigVersion = 1;

ColourModel parse_colour(const JsonValue& value, const Camera& camera) {
  ColourModel colour;
  if (const auto black = value.find("black")) colour.black = black->vec3();
  if (const auto gamma = value.find("gamma")) colour.gamma = gamma->number();
  const auto read = [&value](const char* key, auto& numbers) {
    const auto member = value.find(key);
    if (!member) return;
    const std::vector<JsonValue> values = member->elements(numbers.size());
    for (size_t i = 0; i < numbers.size(); i++) numbers[i] = values[i].number();
  };
  read("matrix", colour.matrix);
  read("vignetting", colour.vignetting);
  const VignettingField field(camera.width, camera.height, camera.principal_point());
  if (const auto fault = model_error(colour, field.most())) value.fail_inside(*fault);
  return colour;
}

Camera parse_camera(const JsonValue& value) {
  Camera camera;
  camera.id = static_cast<uint32_t>(value.at("id").integer(0, UINT32_MAX));
  camera.name = value.at("name").name();
  camera.width = static_cast<int>(value.at("width").integer(1, kMaxImageSize));
  camera.height = static_cast<int>(value.at("height").integer(1, kMaxImageSize));
  camera.lens = parse_lens(value);
  camera.pose.position = value.at("position").vec3();
  camera.pose.orientation = value.at("orientation").unit_quaternion();
  if (const auto image = value.find("image")) camera.image = image->text();
  if (const auto source = value.find("source")) camera.source = source->text();
  if (const auto offset = value.find("time_offset")) camera.time_offset = offset->number();
  if (const auto colour = value.find("colour")) camera.colour = parse_colour(*colour, camera);
  return camera;
}

Topology parse_topology(const JsonValue& value, size_t num_cameras) {
  Topology topology;
  const std::string type = value.at("type").text();
  if (type == "grid") {
    topology.type = Topology::Type::kGrid;
    topology.rows = static_cast<int>(value.at("rows").integer(1, kMaxCameras));
    topology.columns = static_cast<int>(value.at("columns").integer(1, kMaxCameras));
    if (static_cast<uint64_t>(topology.rows) * topology.columns != num_cameras)
      value.fail(std::to_string(topology.rows) + " rows x " + std::to_string(topology.columns) +
                 " columns do not match the rig, which has " + std::to_string(num_cameras) + " cameras");
  } else if (type == "triangles") {
    topology.type = Topology::Type::kTriangles;
    const std::vector<JsonValue> triangles = value.at("triangles").elements();
    // A surface through n points has fewer than 2 n triangles (Euler).
    if (triangles.size() > 2 * num_cameras)
      value.at("triangles")
          .fail("at most " + std::to_string(2 * num_cameras) + " triangles are possible for " +
                std::to_string(num_cameras) + " cameras, but the list has " + std::to_string(triangles.size()));
    for (const JsonValue& triangle : triangles) {
      std::array<CameraIndex, 3> corners;
      const std::vector<JsonValue> values = triangle.elements(3);
      for (int i = 0; i < 3; i++)
        corners[i] = static_cast<CameraIndex>(values[i].integer(0, static_cast<int64_t>(num_cameras) - 1));
      if (corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0])
        triangle.fail("must be three different cameras, because they are the corners of a triangle");
      topology.triangles.push_back(corners);
    }
  } else if (type == "delaunay") {
    topology.type = Topology::Type::kDelaunay;
  } else {
    value.at("type").fail("must be \"grid\", \"triangles\" or \"delaunay\", but is \"" + type + "\"");
  }
  return topology;
}

Rig rig_from_json(const json& root, const std::string& name) {
  const JsonValue file(root, name);
  file.require_format(kRigFormat, kRigVersion);
  Rig rig;
  const JsonValue cameras = file.at("cameras");
  const std::vector<JsonValue> values = cameras.elements();
  if (values.empty()) cameras.fail("a rig needs at least one camera");
  if (values.size() > kMaxCameras)
    cameras.fail("a rig has at most " + std::to_string(kMaxCameras) + " cameras, but this file has " +
                 std::to_string(values.size()));
  std::unordered_map<uint32_t, size_t> index_of_id;
  for (const JsonValue& value : values) {
    Camera camera = parse_camera(value);
    const auto [same, is_new] = index_of_id.emplace(camera.id, rig.cameras.size());
    if (!is_new)
      value.at("id").fail(std::to_string(camera.id) + " is also the id of cameras[" + std::to_string(same->second) +
                          "]");
    rig.cameras.push_back(std::move(camera));
  }
  rig.topology = parse_topology(file.at("topology"), rig.cameras.size());
  if (const auto distance = file.find("focus_distance")) {
    rig.focus_distance = distance->number();
    if (rig.focus_distance <= 0) distance->fail("must be more than 0");
  }
  return rig;
}

const char* foreign_format(const std::string& text) {
  const auto has = [&text](std::string_view word) { return text.find(word) != text.npos; };
  if (has(kRigFormat)) return nullptr;
  if (has("\"transform_matrix\"") || has("\"camera_angle_x\"")) return "nerf FILE --out RIG.json";
  if (has("cam0:") && has("camera_model:")) return "kalibr FILE --out RIG.json";
  if (has("camera_matrix:") || has("opencv-matrix")) return "opencv FILE --out RIG.json";
  if (has("CAMERA_ID") && (has("MODEL") || has("QW"))) return "colmap FOLDER --out RIG.json";
  return nullptr;
}

ordered_json to_json(const ColourModel& colour) {
  const Vec3& black = colour.black;
  return {{"black", {black.x, black.y, black.z}},
          {"gamma", colour.gamma},
          {"matrix", colour.matrix},
          {"vignetting", colour.vignetting}};
}

ordered_json to_json(const Camera& camera) {
  const Vec3& p = camera.pose.position;
  const Quat& q = camera.pose.orientation;
  ordered_json value = {{"id", camera.id}, {"name", camera.name}, {"width", camera.width}, {"height", camera.height}};
  put_lens(camera.lens, value);
  value["position"] = {p.x, p.y, p.z};
  value["orientation"] = {q.w, q.x, q.y, q.z};
  if (!camera.image.empty()) value["image"] = camera.image;
  if (!camera.source.empty()) value["source"] = camera.source;
  if (camera.time_offset != 0) value["time_offset"] = camera.time_offset;
  if (camera.colour) value["colour"] = to_json(*camera.colour);
  return value;
}

ordered_json to_json(const Topology& topology) {
  switch (topology.type) {
    case Topology::Type::kGrid: return {{"type", "grid"}, {"rows", topology.rows}, {"columns", topology.columns}};
    case Topology::Type::kTriangles: return {{"type", "triangles"}, {"triangles", topology.triangles}};
    case Topology::Type::kDelaunay: break;
  }
  return {{"type", "delaunay"}};
}

void keep_unknown(const json& original, std::initializer_list<std::string_view> known, ordered_json& value) {
  if (!original.is_object()) return;
  for (const auto& [key, member] : original.items())
    if (std::find(known.begin(), known.end(), key) == known.end()) value[key] = member;
}

std::optional<double> parse_control(const json& value, const std::string& place) {
  if (value.is_string() && value.get<std::string>() == "auto") return std::nullopt;
  const double number = value.is_number() ? value.get<double>() : NAN;
  if (!std::isfinite(number)) throw Error(place + ": must be a finite number or \"auto\"");
  return number;
}

// Keys that stay in place when two devices are swapped.
constexpr std::array kOfThePlace = {"id", "name", "position", "orientation"};

json& camera_of(json& rig, uint32_t id) {
  for (json& camera : rig["cameras"])
    if (camera["id"] == id) return camera;
  throw Error("there is no camera " + std::to_string(id));
}

}  // namespace

Rig load_rig(const std::string& path) {
  return parse_rig(read_text_file(path), path, std::filesystem::path(path).parent_path().string());
}

bool is_rig_file(const std::string& path) {
  try {
    const json root = parse_json(read_text_file(path), path);
    return root.is_object() && root.value("format", json()) == kRigFormat;
  } catch (const Error&) {
    return false;
  }
}

Rig parse_rig(const std::string& text, const std::string& name, const std::string& directory) {
  if (const char* const format = foreign_format(text))
    throw Error(name + ": is not a rig file; convert it with lf-rig import " + format);
  Rig rig = rig_from_json(parse_json(text, name), name);
  rig.directory = directory;
  return rig;
}

void save_rig(const Rig& rig, const std::string& path, const json* original) {
  AtomicFileWriter file(path);
  // An existing file keeps its mode. A new file with a password is readable by its owner only.
  std::error_code ignored;
  if (std::ranges::any_of(rig.cameras, has_secret) && !std::filesystem::exists(path, ignored))
    fchmod(file.descriptor(), 0600);
  file.write(rig_to_json(rig, original));
  file.commit();
}

void save_rig_like(const std::string& original_path, const Rig& rig, const std::string& path) {
  const json original = parse_json(read_text_file(original_path), original_path);
  save_rig(rig, path, &original);
}

std::string rig_to_json(const Rig& rig, const json* original) {
  std::unordered_map<uint32_t, const json*> original_cameras;
  if (original && original->contains("cameras"))
    for (const json& camera : (*original)["cameras"]) original_cameras.emplace(camera["id"].get<uint32_t>(), &camera);

  // One line per camera keeps the file short and diffs readable.
  std::string text = "{\n \"format\": \"" + std::string(kRigFormat) +
                     "\",\n \"version\": " + std::to_string(kRigVersion) + ",\n \"cameras\": [\n";
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    for (const std::string* name : {&rig.cameras[i].name, &rig.cameras[i].image, &rig.cameras[i].source})
      if (!is_utf8(*name))
        throw Error("cameras[" + std::to_string(i) + "]: " +
                    json(*name).dump(-1, ' ', true, json::error_handler_t::replace) + " is not UTF-8: rename the file");
    const json name = rig.cameras[i].name;
    const std::string place = "cameras[" + std::to_string(i) + "].name";
    JsonValue(name, place).name();  // load_rig() must accept the file
    ordered_json camera = to_json(rig.cameras[i]);
    if (const auto kept = original_cameras.find(rig.cameras[i].id); kept != original_cameras.end())
      keep_unknown(*kept->second,
                   {"id", "name", "width", "height", "model", "params", "position", "orientation", "image", "source",
                    "time_offset", "colour"},
                   camera);
    if (const auto kept = original_cameras.find(rig.cameras[i].id);
        rig.cameras[i].colour && kept != original_cameras.end() && kept->second->contains("colour"))
      keep_unknown((*kept->second)["colour"], {"black", "gamma", "matrix", "vignetting"}, camera["colour"]);
    text += "  " + camera.dump() + (i + 1 < rig.cameras.size() ? ",\n" : "\n");
  }
  ordered_json topology = to_json(rig.topology);
  ordered_json rest;
  if (original) {
    if (original->contains("topology"))
      keep_unknown((*original)["topology"], {"type", "rows", "columns", "triangles"}, topology);
    keep_unknown(*original, {"format", "version", "cameras", "topology", "focus_distance"}, rest);
  }
  text += " ],\n \"topology\": " + topology.dump();
  if (rig.focus_distance > 0) text += ",\n \"focus_distance\": " + json(rig.focus_distance).dump();
  for (const auto& [key, member] : rest.items()) text += ",\n " + json(key).dump() + ": " + member.dump();
  return text + "\n}\n";
}

std::map<uint32_t, Controls> parse_controls(const json& rig, const std::string& name) {
  std::map<uint32_t, Controls> all;
  const auto cameras = rig.find("cameras");
  if (!rig.is_object() || cameras == rig.end() || !cameras->is_array()) return all;
  for (size_t i = 0; i < cameras->size(); i++) {
    const json& camera = (*cameras)[i];
    if (!camera.is_object() || !camera.contains("controls") || !camera.contains("id")) continue;
    const std::string place = name + ": cameras[" + std::to_string(i) + "].controls";
    const json& controls = camera["controls"];
    if (!controls.is_object()) throw Error(place + ": must be an object with the values of the controls");
    const auto id = static_cast<uint32_t>(JsonValue(camera, name).at("id").integer(0, UINT32_MAX));
    for (const auto& [key, value] : controls.items()) all[id][key] = parse_control(value, place + "." + key);
  }
  return all;
}

std::map<uint32_t, Controls> load_controls(const std::string& path) {
  const std::string text = read_text_file(path);
  // Most files have no controls and are not parsed.
  if (text.find("\"controls\"") == std::string::npos) return {};
  return parse_controls(parse_json(text, path), path);
}

void put_controls(const std::map<uint32_t, Controls>& controls, json& rig) {
  for (json& camera : rig["cameras"]) {
    const auto found = controls.find(camera["id"].get<uint32_t>());
    if (found == controls.end()) continue;
    json& to = camera["controls"] = json::object();
    for (const auto& [name, value] : found->second) to[name] = value ? json(*value) : json("auto");
  }
}

void swap_devices(json& rig, uint32_t a, uint32_t b) {
  json &first = camera_of(rig, a), &second = camera_of(rig, b);
  if (a == b) return;
  std::swap(first, second);
  for (const char* key : kOfThePlace) std::swap(first[key], second[key]);
}

}  // namespace lf
