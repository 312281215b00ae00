// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_value.h"
#include "base/yaml_value.h"

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
  value.fail("no lens of ours equals \"" + text + "\"");
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

Rig parse_kalibr(const std::string& text, const std::string& path) {
  const nlohmann::json root = parse_yaml(text, path);
  const JsonValue file(root, path);
  Rig rig;
  RigidMotion world_from_camera;
  while (const auto value = file.find(("cam" + std::to_string(rig.cameras.size())).c_str())) {
    if (rig.cameras.size() >= kMaxCameras) file.fail("at most " + std::to_string(kMaxCameras) + " cameras");
    Camera camera;
    camera.id = static_cast<uint32_t>(rig.cameras.size());
    camera.lens = parse_kalibr_lens(*value);
    const std::vector<JsonValue> size = value->at("resolution").elements(2);
    camera.width = static_cast<int>(size[0].integer(1, kMaxImageSize));
    camera.height = static_cast<int>(size[1].integer(1, kMaxImageSize));
    camera.name = "cam" + std::to_string(camera.id);
    if (const auto topic = value->find("rostopic")) camera.name = name_of_topic(topic->text());
    if (const auto body = value->find("T_cam_imu"); body && (camera.id == 0 || !value->find("T_cn_cnm1")))
      world_from_camera = parse_rigid_motion(*body).inverse();
    else if (camera.id > 0)
      world_from_camera = world_from_camera * parse_rigid_motion(value->at("T_cn_cnm1")).inverse();
    camera.pose = pose_of_world_from_camera(world_from_camera);
    rig.cameras.push_back(camera);
  }
  if (rig.cameras.empty()) file.at("cam0");  // says that it is missing
  return rig;
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
  }
  return text;
}

}  // namespace

RigImport import_kalibr(const std::string& path) { return {parse_kalibr(read_text_file(path), path), {}}; }

RigExport export_kalibr(const Rig& rig, const std::string& path) {
  const std::string text = kalibr_text(rig);
  const RigExport result = describe_export(rig, parse_kalibr(text, path), {.images = false, .ids = false});
  write_text_file(text, path);
  return result;
}

}  // namespace lf
