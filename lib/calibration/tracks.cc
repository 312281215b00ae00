// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/tracks.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <set>
#include <sstream>
#include <tuple>
#include <unordered_map>

#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "base/text.h"
#include "rig/rig.h"

namespace lf {

namespace {

// Detectors may extrapolate up to half an image beyond the border; more indicates a wrong size or unit.
bool is_near_image(const Vec2& pixel, int width, int height) {
  return std::abs(pixel.x - width / 2.0) <= width && std::abs(pixel.y - height / 2.0) <= height;
}

}  // namespace

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
      fail("observations", i,
           "light " + std::to_string(o.light) +
               (tracks.bar ? ": must be 0 or 1" : ": must be 0, because \"bar\" is false"));
    const Tracks::Camera& camera = tracks.cameras[o.camera];
    if (!is_near_image(o.pixel, camera.width, camera.height))
      fail("observations", i,
           format_text("(%f, %f)", o.pixel.x, o.pixel.y) + " is far outside of camera " + std::to_string(camera.id) +
               "'s image");
    if (!seen.insert({o.camera, o.position, o.light}).second)
      fail("observations", i, "camera " + std::to_string(camera.id) + " sees the same light twice");
  }
}

namespace {

using nlohmann::json;

constexpr char kTracksFormat[] = "lightfield-tracks";
constexpr int kTracksVersion = 1;

// Reads the members that the cameras of both variants of the format have.
template <class Camera>
Camera parse_camera(const JsonValue& value) {
  Camera camera;
  camera.id = static_cast<uint32_t>(value.at("id").integer(0, UINT32_MAX));
  camera.width = static_cast<int>(value.at("width").integer(1, kMaxImageSize));
  camera.height = static_cast<int>(value.at("height").integer(1, kMaxImageSize));
  return camera;
}

}  // namespace

Tracks load_tracks(const std::string& path) { return parse_tracks(read_text_file(path), path); }

Tracks parse_tracks(const std::string& text, const std::string& name) {
  const json root = parse_json(text, name);
  const JsonValue file(root, name);
  file.require_format(kTracksFormat, kTracksVersion);
  Tracks tracks;
  if (const auto bar = file.find("bar")) tracks.bar = bar->flag();
  if (const auto ordered = file.find("ordered")) tracks.ordered = ordered->flag();
  std::unordered_map<uint32_t, uint32_t> index_of_id;
  for (const JsonValue& value : file.at("cameras").elements()) {
    const auto camera = parse_camera<Tracks::Camera>(value);
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
  std::vector<json> positions(tracks.num_positions, json::array());
  for (const Observation& o : tracks.observations) {
    json value = {tracks.cameras[o.camera].id, o.pixel.x, o.pixel.y};
    if (tracks.bar) value.push_back(o.light);
    positions.at(o.position).push_back(std::move(value));
  }
  json cameras = json::array();
  for (const Tracks::Camera& c : tracks.cameras)
    cameras.push_back({{"id", c.id}, {"width", c.width}, {"height", c.height}});
  std::string text =
      "{\n \"format\": \"" + std::string(kTracksFormat) + "\",\n \"version\": " + std::to_string(kTracksVersion) +
      ",\n \"bar\": " + (tracks.bar ? "true" : "false") + ",\n \"ordered\": " + (tracks.ordered ? "true" : "false") +
      ",\n \"cameras\": " + cameras.dump() + ",\n \"positions\": [\n";
  for (size_t i = 0; i < positions.size(); i++)
    text += "  {\"observations\": " + positions[i].dump() + (i + 1 < positions.size() ? "},\n" : "}\n");
  return text + " ]\n}\n";
}

namespace {

namespace fs = std::filesystem;

using Table = std::vector<std::vector<double>>;

Table read_table(const fs::path& path) {
  const ScopedCLocale numbers;
  Table table;
  std::istringstream text(read_text_file(path.string()));
  size_t number = 0;
  for (std::string line; std::getline(text, line);) {
    number++;
    std::vector<double> row;
    const char* at = line.c_str();
    for (char* end;; at = end) {
      const double value = std::strtod(at, &end);  // also parses "nan"
      if (end == at) break;
      row.push_back(value);
    }
    if (std::string_view(at).find_first_not_of(" \t\r") != std::string_view::npos)
      throw Error(path.string() + ": line " + std::to_string(number) + ": not a number: \"" + at + "\"");
    if (row.empty()) continue;
    if (!table.empty() && row.size() != table[0].size())
      throw Error(path.string() + ": line " + std::to_string(number) + ": has " + std::to_string(row.size()) +
                  " columns, but the first row has " + std::to_string(table[0].size()));
    table.push_back(std::move(row));
  }
  if (table.empty()) throw Error(path.string() + ": is empty");
  return table;
}

Lens read_rad(const fs::path& path, double first_pixel) {
  const ScopedCLocale numbers;
  std::map<std::string, double> values;
  std::istringstream text(read_text_file(path.string()));
  for (std::string line; std::getline(text, line);) {
    char name[16];
    double value;
    if (std::sscanf(line.c_str(), " %15[A-Za-z0-9] = %lf", name, &value) == 2) values[name] = value;
  }
  for (const char* name : {"K11", "K22", "K13", "K23"})
    if (!values.count(name)) throw Error(path.string() + ": " + name + " is missing");
  return Lens(LensModel::kOpenCv,
              {values["K11"], values["K22"], values["K13"] - first_pixel, values["K23"] - first_pixel, values["kc1"],
               values["kc2"], values["kc3"], values["kc4"]});
}

}  // namespace

MultiCamSelfCal load_multicamselfcal(const std::string& directory, double first_pixel) {
  const fs::path folder(directory);
  const Table points = read_table(folder / "points.dat"), seen = read_table(folder / "IdMat.dat"),
              sizes = read_table(folder / "Res.dat");
  const size_t cameras = sizes.size(), positions = points[0].size();
  if (sizes[0].size() != 2) throw Error((folder / "Res.dat").string() + ": must have 2 columns, width and height");
  const auto require = [&](const char* file, const Table& table, size_t rows) {
    if (table.size() != rows || table[0].size() != positions)
      throw Error((folder / file).string() + ": must have " + std::to_string(rows) + " rows of " +
                  std::to_string(positions) + " columns for " + std::to_string(cameras) + " cameras, has " +
                  std::to_string(table.size()) + " of " + std::to_string(table[0].size()));
  };
  require("points.dat", points, 3 * cameras);
  require("IdMat.dat", seen, cameras);
  MultiCamSelfCal result;
  result.tracks.num_positions = positions;
  for (size_t i = 0; i < cameras; i++)
    result.tracks.cameras.push_back(
        {static_cast<uint32_t>(i), static_cast<int>(sizes[i][0]), static_cast<int>(sizes[i][1])});
  for (size_t j = 0; j < positions; j++)
    for (size_t i = 0; i < cameras; i++) {
      const double u = points[3 * i][j], v = points[3 * i + 1][j];
      if (seen[i][j] == 0) continue;
      if (!std::isfinite(u) || !std::isfinite(v))
        throw Error((folder / "points.dat").string() + ": camera " + std::to_string(i) + ", position " +
                    std::to_string(j) + ": not a number, although IdMat.dat says that the camera sees the light");
      result.tracks.observations.push_back(
          {static_cast<uint32_t>(i), static_cast<uint32_t>(j), 0, Vec2(u - first_pixel, v - first_pixel)});
    }
  check_tracks(result.tracks, (folder / "points.dat").string());

  std::vector<fs::path> lenses;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.path().extension() == ".rad") lenses.push_back(entry.path());
  if (lenses.empty()) return result;
  std::ranges::sort(lenses, natural_less, [](const fs::path& path) { return path.filename().string(); });
  if (lenses.size() != cameras)
    throw Error(directory + ": " + std::to_string(lenses.size()) + " files *.rad for " + std::to_string(cameras) +
                " cameras");
  result.lenses.emplace();
  for (size_t i = 0; i < cameras; i++) {
    Camera camera;
    camera.id = static_cast<uint32_t>(i);
    camera.name = "cam_" + std::to_string(i);
    camera.width = result.tracks.cameras[i].width, camera.height = result.tracks.cameras[i].height;
    camera.lens = read_rad(lenses[i], first_pixel);
    result.lenses->cameras.push_back(camera);
  }
  return result;
}

namespace {

LightDetection parse_detection(const JsonValue& value, const LightDetections::Camera& camera) {
  const std::vector<JsonValue> v = value.elements(4);
  LightDetection sight;
  sight.pixel = {v[0].number(), v[1].number()};
  sight.sigma = v[2].number();
  sight.brightness = v[3].number();
  if (!is_near_image(sight.pixel, camera.width, camera.height)) value.fail("is far outside of the camera's image");
  if (!(sight.sigma > 0)) v[2].fail("must be positive");
  if (!(sight.brightness > 0)) v[3].fail("must be positive");
  return sight;
}

// Rounds to shorten numbers; `steps` exceeds the accuracy of detections.
double rounded(double value, double steps) { return std::round(value * steps) / steps; }

}  // namespace

std::optional<LightDetections> parse_light_detections(const std::string& text, const std::string& name) {
  const json root = parse_json(text, name);
  const JsonValue file(root, name);
  file.require_format(kTracksFormat, kTracksVersion);
  if (file.find("positions")) return std::nullopt;
  LightDetections sights;
  if (const auto bar = file.find("bar")) sights.bar = bar->flag();
  std::set<uint32_t> ids;
  for (const JsonValue& value : file.at("cameras").elements()) {
    auto& camera = sights.cameras.emplace_back(parse_camera<LightDetections::Camera>(value));
    if (!ids.insert(camera.id).second) value.fail_inside("id: " + std::to_string(camera.id) + " comes twice");
    for (const JsonValue& entry : value.at("frames").elements()) {
      const std::vector<JsonValue> parts = entry.elements();
      if (parts.empty()) entry.fail("must begin with its time");
      LightDetections::Frame frame{parts[0].number(), {}};
      if (!camera.frames.empty() && !(frame.time > camera.frames.back().time))
        parts[0].fail("must be later than the previous frame");
      for (size_t i = 1; i < parts.size(); i++) frame.sights.push_back(parse_detection(parts[i], camera));
      camera.frames.push_back(std::move(frame));
    }
  }
  return sights;
}

std::string light_detections_to_json(const LightDetections& sights) {
  std::string text = "{\n \"format\": \"" + std::string(kTracksFormat) +
                     "\",\n \"version\": " + std::to_string(kTracksVersion) +
                     ",\n \"bar\": " + (sights.bar ? "true" : "false") + ",\n \"cameras\": [";
  const char* between = "\n";
  for (const LightDetections::Camera& camera : sights.cameras) {
    text += between + std::string("  {\"id\": ") + std::to_string(camera.id) +
            ", \"width\": " + std::to_string(camera.width) + ", \"height\": " + std::to_string(camera.height) +
            ", \"frames\": [";
    between = ",\n";
    const char* before = "\n";
    for (const LightDetections::Frame& frame : camera.frames) {
      json entry = {rounded(frame.time, 1e9)};
      for (const LightDetection& s : frame.sights)
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
