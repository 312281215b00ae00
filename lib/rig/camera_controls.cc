// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/camera_controls.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_value.h"

namespace lf {
namespace {

using nlohmann::json;

std::optional<double> parse_control(const json& value, const std::string& place) {
  if (value.is_string() && value.get<std::string>() == "auto") return std::nullopt;
  const double number = value.is_number() ? value.get<double>() : NAN;
  if (!std::isfinite(number)) throw Error(place + ": must be a finite number or \"auto\"");
  return number;
}

}  // namespace

std::map<uint32_t, Controls> parse_controls(const json& rig, const std::string& name) {
  std::map<uint32_t, Controls> all;
  const auto cameras = rig.find("cameras");
  if (!rig.is_object() || cameras == rig.end() || !cameras->is_array()) return all;
  for (size_t i = 0; i < cameras->size(); i++) {
    const json& camera = (*cameras)[i];
    if (!camera.is_object() || !camera.contains("controls") || !camera.contains("id")) continue;
    const std::string place = name + ": cameras[" + std::to_string(i) + "].controls";
    const json& controls = camera["controls"];
    if (!controls.is_object()) throw Error(place + ": must be an object");
    const auto id = static_cast<uint32_t>(JsonValue(camera, name).at("id").integer(0, UINT32_MAX));
    for (const auto& [key, value] : controls.items()) all[id][key] = parse_control(value, place + "." + key);
  }
  return all;
}

std::map<uint32_t, Controls> load_controls(const std::string& path) {
  const std::string text = read_text_file(path);
  // Each camera of an array asks for itself: most files have none, and need not be parsed for it.
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

}  // namespace lf
