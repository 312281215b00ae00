// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "base/text.h"
#include "rig/exchange.h"

namespace lf {
namespace {

constexpr double kPixelCentre = 0.5;     // position of the centre of the top-left pixel
constexpr double kInfiniteDepth = 1000;  // in RVS

const std::set<std::string_view> kKnownKeys = {
    // Keys that the importer reads.
    "cameras", "sourceCameraNames", "Name", "Resolution", "Projection", "Focal", "Principle_point", "Position",
    "Rotation", "Depth_range", "lengthsInMeters",
    // Keys without effect on a rig.
    "Version", "Content_name", "contentName", "BoundingBox_center", "Fps", "fps", "Frames_number", "frameCount",
    "Informative", "Depthmap", "Background", "BitDepthColor", "BitDepthDepth", "ColorSpace", "DepthColorSpace",
    "HasInvalidDepth", "Multi_depth_range", "DisplacementMethod"};

// Converts from the axes forward, left, up to the axes right, down, forward, and back.
Vec3 turned(const Vec3& v) { return {-v.y, -v.z, v.x}; }
Vec3 turned_back(const Vec3& v) { return {v.z, -v.x, -v.y}; }

Camera parse_camera(const JsonValue& value) {
  Camera camera;
  camera.name = value.at("Name").name();
  const JsonValue projection = value.at("Projection");
  if (projection.text() != "Perspective")
    projection.fail("a rig cannot hold the projection \"" + projection.text() + "\", only \"Perspective\"");
  parse_image_size(value.at("Resolution"), camera);
  const JsonValue focal = value.at("Focal");
  const std::vector<double> f = parse_numbers(focal, 2), centre = parse_numbers(value.at("Principle_point"), 2);
  camera.lens = lens_from_opencv(focal, {f[0], f[1], centre[0] - kPixelCentre, centre[1] - kPixelCentre}, {}, false);
  const Vec3 degrees = value.at("Rotation").vec3();
  const Mat3 axes = rotation_from_euler(Vec3(degrees.z, degrees.y, degrees.x) * (M_PI / 180));
  // The columns of `axes` are the camera's axes forward, left and up.
  camera.pose = pose_of_world_from_camera(
      {Mat3(turned(-axes[1]), turned(-axes[2]), turned(axes[0])), turned(value.at("Position").vec3())});
  return camera;
}

// Widens the range of depths by the range of a camera.
void add_depths(const JsonValue& camera, double& near, double& far) {
  const auto value = camera.find("Depth_range");
  if (!value) return;
  const std::vector<double> range = parse_numbers(*value, 2);
  if (!(range[0] > 0 && range[1] > range[0])) value->fail("must be [near, far] with 0 < near < far");
  near = std::min(near, range[0]);
  far = std::max(far, range[1]);
}

RigImport parse_miv(const std::string& text, const std::string& path) {
  const nlohmann::json root = parse_json(text, path);
  const JsonValue file(root, path), cameras = file.at("cameras");
  std::optional<std::set<std::string>> sources;
  if (const auto names = file.find("sourceCameraNames")) {
    sources.emplace();
    for (const JsonValue& name : names->elements())
      if (!sources->insert(name.text()).second) name.fail("occurs twice; remove one of the two names");
  }
  RigImport result;
  result.notes = check_foreign_keys(root, path, kKnownKeys);
  const auto in_metres = file.find("lengthsInMeters");
  result.has_unit = !in_metres || in_metres->flag();
  double near = HUGE_VAL, far = 0;
  std::string left_out;
  std::set<std::string> names;
  for (const JsonValue& value : cameras.elements()) {
    const std::string name = value.at("Name").name();
    if (!names.insert(name).second) value.at("Name").fail("is the name of two cameras");
    if (sources ? !sources->contains(name) : name == "viewport") {
      left_out += (left_out.empty() ? "" : ", ") + name;
      continue;
    }
    add_camera(parse_camera(value), result);
    add_depths(value, near, far);
  }
  if (sources)
    for (const std::string& name : *sources)
      if (!names.contains(name)) file.at("sourceCameraNames").fail("\"" + name + "\" is not in the list of cameras");
  if (result.rig.cameras.empty() || result.rig.cameras.size() > kMaxCameras)
    cameras.fail("must have 1 to " + std::to_string(kMaxCameras) + " cameras, but has " +
                 std::to_string(result.rig.cameras.size()));
  if (!left_out.empty()) result.notes.push_back("cameras that are not sources were left out: " + left_out);
  if (far > 0) result.near = near;
  if (far > 0 && far < kInfiniteDepth) result.far = far;
  return result;
}

nlohmann::ordered_json miv_camera(const Camera& camera, double near, double far) {
  const Lens& lens = camera.lens;
  if (lens.has_distortion() || lens.distortion().fisheye)
    throw_camera_error(camera, std::string("the format cannot hold distorted lenses; ") + kUndistortRemedy);
  const Vec3 position = turned_back(camera.pose.position);
  const Mat3 axes(turned_back(camera.pose.forward()), turned_back(-camera.pose.right()),
                  turned_back(-camera.pose.down()));
  const Vec3 degrees = euler_from_rotation(axes) * (180 / M_PI);
  return {{"Name", camera.name},
          {"Resolution", {camera.width, camera.height}},
          {"Projection", "Perspective"},
          {"Focal", {lens.fx(), lens.fy()}},
          {"Principle_point", {lens.cx() + kPixelCentre, lens.cy() + kPixelCentre}},
          {"Position", {position.x, position.y, position.z}},
          {"Rotation", {degrees.z, degrees.y, degrees.x}},
          {"Depth_range", {near, far}}};
}

}  // namespace

RigImport import_miv(const std::string& path) { return with_topology(parse_miv(read_text_file(path), path)); }

RigExport export_miv(const Rig& rig, const std::string& path, double near, double far) {
  nlohmann::ordered_json names = nlohmann::json::array(), cameras = names;
  for (const Camera& camera : rig.cameras) {
    if (camera.name.empty()) throw_camera_error(camera, "has no name, but the format requires one; add a name");
    names.push_back(camera.name);
    cameras.push_back(miv_camera(camera, near, far));
  }
  const nlohmann::ordered_json root = {
      {"Version", "2.0"}, {"lengthsInMeters", true}, {"sourceCameraNames", names}, {"cameras", cameras}};
  const std::string text = root.dump(2) + "\n";
  const RigExport result = describe_export(rig, parse_miv(text, path).rig, {.images = false, .ids = false});
  write_text_file(text, path);
  return result;
}

}  // namespace lf
