// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/tracks.h"

#include <set>
#include <tuple>
#include <unordered_map>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_value.h"
#include "rig/rig.h"

namespace lf {
void check_tracks(const Tracks& tracks, const std::string& name) {
  const auto fail = [&](const char* list, size_t i, const std::string& what) {
    throw Error(name + ": " + list + "[" + std::to_string(i) + "]: " + what);
  };
  std::set<uint32_t> ids;
  for (size_t i = 0; i < tracks.cameras.size(); i++) {
    const Tracks::Camera& camera = tracks.cameras[i];
    if (!ids.insert(camera.id).second) fail("cameras", i, "id " + std::to_string(camera.id) + " comes twice");
    if (camera.width < 1 || camera.height < 1 || camera.width > kMaxImageSize || camera.height > kMaxImageSize)
      fail("cameras", i, "width and height must be 1 to " + std::to_string(kMaxImageSize));
  }
  std::set<std::tuple<uint32_t, uint32_t, uint32_t>> seen;
  for (size_t i = 0; i < tracks.observations.size(); i++) {
    const Observation& o = tracks.observations[i];
    if (o.camera >= tracks.cameras.size())
      fail("observations", i,
           "camera " + std::to_string(o.camera) + " is not one of the " + std::to_string(tracks.cameras.size()) +
               " cameras");
    if (o.position >= tracks.num_positions)
      fail("observations", i, "position " + std::to_string(o.position) + " is out of range");
    if (o.light > (tracks.bar ? 1u : 0u))
      fail("observations", i, "light " + std::to_string(o.light) + (tracks.bar ? ": must be 0 or 1" : ": not a bar"));
    const Tracks::Camera& camera = tracks.cameras[o.camera];
    // Half an image beyond the border is a light that a detector extrapolated; more is a mistaken size or unit.
    const bool near = std::abs(o.pixel.x - camera.width / 2.0) <= camera.width &&
                      std::abs(o.pixel.y - camera.height / 2.0) <= camera.height;
    if (!near)
      fail("observations", i,
           "(" + std::to_string(o.pixel.x) + ", " + std::to_string(o.pixel.y) + ") is far outside of camera " +
               std::to_string(camera.id) + "'s image");
    if (!seen.insert({o.camera, o.position, o.light}).second)
      fail("observations", i, "camera " + std::to_string(camera.id) + " sees the same light twice");
  }
}

namespace {

using nlohmann::json;

constexpr char kFormat[] = "lightfield-tracks";
constexpr int kVersion = 1;

bool flag(const JsonValue& file, const json& root, const char* key, bool otherwise) {
  const auto value = file.find(key);
  if (!value) return otherwise;
  if (!root[key].is_boolean()) value->fail("must be true or false");
  return root[key].get<bool>();
}

}  // namespace

Tracks load_tracks(const std::string& path) { return parse_tracks(read_text_file(path), path); }

Tracks parse_tracks(const std::string& text, const std::string& name) {
  const json root = parse_json(text, name);
  const JsonValue file(root, name);
  file.require_format(kFormat, kVersion);
  Tracks tracks;
  tracks.bar = flag(file, root, "bar", false);
  tracks.ordered = flag(file, root, "ordered", true);
  std::unordered_map<uint32_t, uint32_t> index_of_id;
  for (const JsonValue& value : file.at("cameras").elements()) {
    Tracks::Camera camera;
    camera.id = static_cast<uint32_t>(value.at("id").integer(0, UINT32_MAX));
    camera.width = static_cast<int>(value.at("width").integer(1, kMaxImageSize));
    camera.height = static_cast<int>(value.at("height").integer(1, kMaxImageSize));
    index_of_id.emplace(camera.id, static_cast<uint32_t>(tracks.cameras.size()));
    tracks.cameras.push_back(camera);
  }
  for (const JsonValue& position : file.at("positions").elements()) {
    for (const JsonValue& value : position.at("observations").elements()) {
      const std::vector<JsonValue> v = value.elements(tracks.bar ? 4 : 3);
      const auto id = static_cast<uint32_t>(v[0].integer(0, UINT32_MAX));
      const auto index = index_of_id.find(id);
      if (index == index_of_id.end()) v[0].fail(std::to_string(id) + " is not the id of one of the cameras");
      Observation o{index->second, static_cast<uint32_t>(tracks.num_positions)};
      o.pixel = {v[1].number(), v[2].number()};
      if (tracks.bar) o.light = static_cast<uint32_t>(v[3].integer(0, 1));
      tracks.observations.push_back(o);
    }
    tracks.num_positions++;
  }
  check_tracks(tracks, name);
  return tracks;
}

std::string tracks_to_json(const Tracks& tracks) {
  // One line a position: small enough to read.
  std::vector<json> positions(tracks.num_positions, json::array());
  for (const Observation& o : tracks.observations) {
    json value = {tracks.cameras[o.camera].id, o.pixel.x, o.pixel.y};
    if (tracks.bar) value.push_back(o.light);
    positions.at(o.position).push_back(std::move(value));
  }
  json cameras = json::array();
  for (const Tracks::Camera& c : tracks.cameras)
    cameras.push_back({{"id", c.id}, {"width", c.width}, {"height", c.height}});
  std::string text = "{\n \"format\": \"" + std::string(kFormat) + "\",\n \"version\": " + std::to_string(kVersion) +
                     ",\n \"bar\": " + (tracks.bar ? "true" : "false") +
                     ",\n \"ordered\": " + (tracks.ordered ? "true" : "false") + ",\n \"cameras\": " + cameras.dump() +
                     ",\n \"positions\": [\n";
  for (size_t i = 0; i < positions.size(); i++)
    text += "  {\"observations\": " + positions[i].dump() + (i + 1 < positions.size() ? "},\n" : "}\n");
  return text + " ]\n}\n";
}

}  // namespace lf
