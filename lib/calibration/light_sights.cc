// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/light_sights.h"

#include <cmath>
#include <set>

#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "calibration/tracks.h"
#include "rig/rig.h"

namespace lf {
namespace {

using nlohmann::json;

Sight parse_sight(const JsonValue& value, const LightSights::Camera& camera) {
  const std::vector<JsonValue> v = value.elements(4);
  Sight sight;
  sight.pixel = {v[0].number(), v[1].number()};
  sight.sigma = v[2].number();
  sight.brightness = v[3].number();
  const bool near = std::abs(sight.pixel.x - camera.width / 2.0) <= camera.width &&
                    std::abs(sight.pixel.y - camera.height / 2.0) <= camera.height;
  if (!near) value.fail("is far outside of the camera's image");
  if (!(sight.sigma > 0)) v[2].fail("must be positive");
  if (!(sight.brightness > 0)) v[3].fail("must be positive");
  return sight;
}

// Shorter numbers, none of which says less than a light is measured to.
double rounded(double value, double steps) { return std::round(value * steps) / steps; }

}  // namespace

std::optional<LightSights> parse_light_sights(const std::string& text, const std::string& name) {
  const json root = parse_json(text, name);
  const JsonValue file(root, name);
  file.require_format(kTracksFormat, kTracksVersion);
  if (file.find("positions")) return std::nullopt;
  LightSights sights;
  if (const auto bar = file.find("bar")) sights.bar = bar->flag();
  std::set<uint32_t> ids;
  for (const JsonValue& value : file.at("cameras").elements()) {
    LightSights::Camera& camera = sights.cameras.emplace_back();
    camera.id = static_cast<uint32_t>(value.at("id").integer(0, UINT32_MAX));
    if (!ids.insert(camera.id).second) value.fail_inside("id: " + std::to_string(camera.id) + " comes twice");
    camera.width = static_cast<int>(value.at("width").integer(1, kMaxImageSize));
    camera.height = static_cast<int>(value.at("height").integer(1, kMaxImageSize));
    for (const JsonValue& entry : value.at("frames").elements()) {
      const std::vector<JsonValue> parts = entry.elements();
      if (parts.empty()) entry.fail("must begin with its time");
      LightSights::Frame frame{parts[0].number(), {}};
      if (!camera.frames.empty() && !(frame.time > camera.frames.back().time))
        parts[0].fail("must be later than that of the frame before");
      for (size_t i = 1; i < parts.size(); i++) frame.sights.push_back(parse_sight(parts[i], camera));
      camera.frames.push_back(std::move(frame));
    }
  }
  return sights;
}

std::string light_sights_to_json(const LightSights& sights) {
  std::string text = "{\n \"format\": \"" + std::string(kTracksFormat) +
                     "\",\n \"version\": " + std::to_string(kTracksVersion) +
                     ",\n \"bar\": " + (sights.bar ? "true" : "false") +
                     ",\n \"cameras\": [";
  const char* between = "\n";
  for (const LightSights::Camera& camera : sights.cameras) {
    text += between + std::string("  {\"id\": ") + std::to_string(camera.id) +
            ", \"width\": " + std::to_string(camera.width) + ", \"height\": " + std::to_string(camera.height) +
            ", \"frames\": [";
    between = ",\n";
    const char* before = "\n";
    for (const LightSights::Frame& frame : camera.frames) {
      json entry = {rounded(frame.time, 1e9)};
      for (const Sight& s : frame.sights)
        entry.push_back({rounded(s.pixel.x, 1e4), rounded(s.pixel.y, 1e4), std::max(1e-4, rounded(s.sigma, 1e4)),
                         std::max(0.1, rounded(s.brightness, 10))});
      text += before + ("   " + entry.dump());
      before = ",\n";
    }
    text += "]}";
  }
  return text + "\n ]\n}\n";
}

}  // namespace lf
