// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"

#include <charconv>
#include <map>
#include <set>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_value.h"
#include "base/yaml_value.h"
#include "rig/foreign_keys.h"

namespace lf {
namespace {

constexpr char kTopicEnd[] = "/image_raw";

std::string name_of_topic(std::string topic) {
  if (topic.ends_with(kTopicEnd)) topic.resize(topic.size() - std::size(kTopicEnd) + 1);
  if (topic.starts_with("/")) topic.erase(0, 1);
  return topic;
}

std::vector<double> numbers(const JsonValue& value) {
  std::vector<double> result;
  for (const JsonValue& element : value.elements()) result.push_back(element.number());
  return result;
}

void require(const JsonValue& value, std::initializer_list<std::string> known) {
  const std::string text = value.text();
  for (const std::string& name : known)
    if (text == name) return;
  value.fail("a rig cannot hold the lens model \"" + text + "\"; " + kUndistortRemedy);
}

Lens parse_kalibr_lens(const JsonValue& camera) {
  require(camera.at("camera_model"), {"pinhole"});
  const JsonValue model = camera.at("distortion_model");
  require(model, {"radtan", "none"});
  const JsonValue place = camera.at("intrinsics");
  const std::vector<double> k = numbers(place);
  if (k.size() != 4) place.fail("must be [fx, fy, cx, cy]");
  std::vector<double> distortion;
  if (model.text() == "radtan") {
    const JsonValue terms = camera.at("distortion_coeffs");
    distortion = numbers(terms);
    if (distortion.size() != 4) terms.fail("must be [k1, k2, p1, p2]");
  }
  try {
    return lens_of_opencv_terms({k[0], k[1], k[2], k[3]}, distortion);
  } catch (const Error& e) {
    place.fail(e.what());
  }
}

// The cameras "cam0", "cam1", ... by their numbers, which may have gaps.
std::map<uint32_t, std::string> find_cameras(const nlohmann::json& root, const JsonValue& file) {
  std::map<uint32_t, std::string> cameras;
  if (!root.is_object()) return cameras;
  for (const auto& [key, value] : root.items()) {
    if (!key.starts_with("cam")) continue;
    uint32_t number = 0;
    const char* const end = key.data() + key.size();
    if (const auto [rest, error] = std::from_chars(key.data() + 3, end, number); error != std::errc() || rest != end)
      continue;
    const auto [other, is_new] = cameras.emplace(number, key);
    if (!is_new) file.fail(other->second + " and " + key + " have the same number");
  }
  if (cameras.size() > kMaxCameras) file.fail("at most " + std::to_string(kMaxCameras) + " cameras");
  return cameras;
}

// Where the camera stands: by the camera of the number before it, which is `before` if the file has it, or by the IMU.
RigidMotion place_of(const JsonValue& camera, const RigidMotion* before, uint32_t number, bool is_first) {
  const auto step = camera.find("T_cn_cnm1"), from_imu = camera.find("T_cam_imu"), to_imu = camera.find("T_imu_cam");
  if (step && before) return *before * parse_rigid_motion(*step).inverse();
  if (from_imu) return parse_rigid_motion(*from_imu).inverse();
  if (to_imu) return parse_rigid_motion(*to_imu);
  if (step)
    step->fail("is relative to cam" + std::to_string(number - 1) +
               ", which the file does not have; add that camera, or T_cam_imu to this one");
  if (!is_first) camera.at("T_cn_cnm1");  // says that it is missing
  return {};
}

RigImport parse_kalibr(const std::string& text, const std::string& path) {
  const nlohmann::json root = parse_yaml(text, path);
  const JsonValue file(root, path);
  const std::map<uint32_t, std::string> cameras = find_cameras(root, file);
  if (cameras.empty()) file.at("cam0");  // says that it is missing
  std::set<std::string_view> known = {"cam_overlaps", "camera_model", "distortion_coeffs", "distortion_model",
                                      "intrinsics",   "resolution",   "rostopic",          "T_cam_imu",
                                      "T_cn_cnm1",    "T_imu_cam",    "timeshift_cam_imu"};
  for (const auto& [number, key] : cameras) known.insert(key);
  RigImport result;
  result.notes = check_foreign_keys(root, path, known);
  std::map<uint32_t, RigidMotion> places;
  for (const auto& [number, key] : cameras) {
    const JsonValue value = file.at(key.c_str());
    Camera camera;
    camera.id = number;
    camera.lens = parse_kalibr_lens(value);
    const std::vector<JsonValue> size = value.at("resolution").elements(2);
    camera.width = static_cast<int>(size[0].integer(1, kMaxImageSize));
    camera.height = static_cast<int>(size[1].integer(1, kMaxImageSize));
    camera.name = key;
    if (const auto topic = value.find("rostopic")) camera.name = name_of_topic(topic->text());
    // Kalibr: time of the IMU = time of the camera + shift.
    if (const auto shift = value.find("timeshift_cam_imu")) camera.time_offset = shift->number();
    const auto before = number > 0 ? places.find(number - 1) : places.end();
    const RigidMotion place =
        place_of(value, before != places.end() ? &before->second : nullptr, number, places.empty());
    places.emplace(number, place);
    camera.pose = pose_of_world_from_camera(place);
    result.rig.cameras.push_back(camera);
  }
  return result;
}

std::string list(std::initializer_list<double> values) {
  std::string text;
  for (const double value : values) text += (text.empty() ? "[" : ", ") + yaml_number(value);
  return text + "]";
}

std::string kalibr_text(const Rig& rig) {
  std::string text;
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    const Camera& camera = rig.cameras[i];
    const Lens& lens = camera.lens;
    const RigidMotion here = camera_from_world(camera.pose);
    const auto line = [&](const char* key, const std::string& value) {
      text += std::string("  ") + key + ": " + value + "\n";
    };
    text += "cam" + std::to_string(i) + ":\n";
    if (i > 0) {
      // Differences of positions first: nothing is lost far from the origin.
      const Pose& before = rig.cameras[i - 1].pose;
      const RigidMotion step = {here.rotation * before.rotation(),
                                here.rotation * (before.position - camera.pose.position)};
      line("T_cn_cnm1", rigid_motion_text(step));
    } else {
      line("T_cam_imu", rigid_motion_text(here));
    }
    line("camera_model", "pinhole");
    line("intrinsics", list({lens.fx(), lens.fy(), lens.cx(), lens.cy()}));
    line("distortion_model", "radtan");
    line("distortion_coeffs", list({lens.k1(), lens.k2(), lens.p1(), lens.p2()}));
    line("resolution", "[" + std::to_string(camera.width) + ", " + std::to_string(camera.height) + "]");
    line("rostopic", nlohmann::json("/" + camera.name + kTopicEnd).dump());
    if (camera.time_offset != 0) line("timeshift_cam_imu", yaml_number(camera.time_offset));
  }
  return text;
}

}  // namespace

RigImport import_kalibr(const std::string& path) { return with_topology(parse_kalibr(read_text_file(path), path)); }

RigExport export_kalibr(const Rig& rig, const std::string& path) {
  const std::string text = kalibr_text(rig);
  const RigExport result =
      describe_export(rig, parse_kalibr(text, path).rig, {.images = false, .ids = false, .time_offsets = true});
  write_text_file(text, path);
  return result;
}

}  // namespace lf
