// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"

#include <cmath>
#include <filesystem>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_value.h"
#include "image/image_file.h"

namespace lf {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr double kNerfPixelCentre = 0.5;  // where NeRF has the centre of the top-left pixel

// Between its axes (y up, z back) and ours, both ways.
Mat3 turned(const Mat3& rotation) { return {rotation[0], -rotation[1], -rotation[2]}; }

// A frame, with the top of the file behind it.
class Frame {
 public:
  Frame(const JsonValue& frame, const JsonValue& file) : frame_(frame), file_(file) {}
  std::optional<JsonValue> find(const char* key) const {
    const auto value = frame_.find(key);
    return value ? value : file_.find(key);
  }
  double number(const char* key, double otherwise) const {
    const auto value = find(key);
    return value ? value->number() : otherwise;
  }

 private:
  const JsonValue &frame_, &file_;
};

Lens parse_lens(const Frame& frame, const JsonValue& place, int width, int height) {
  if (const auto model = frame.find("camera_model")) {
    const std::string name = model->text();
    if (name != "OPENCV" && name != "PINHOLE" && name != "SIMPLE_PINHOLE")
      model->fail("no lens of ours equals its " + name + " without loss");
  }
  for (const char* key : {"k3", "k4", "is_fisheye"})
    if (const auto value = frame.find(key)) {
      const bool is_set = std::string(key) == "is_fisheye" ? value->flag() : value->number() != 0;
      if (is_set) value->fail("is set, and no lens of ours has it");
    }
  double fx = frame.number("fl_x", 0);
  const double angle_x = frame.number("camera_angle_x", 0), angle_y = frame.number("camera_angle_y", 0);
  if (fx == 0 && angle_x > 0 && angle_x < M_PI) fx = width / 2.0 / std::tan(angle_x / 2);
  if (fx == 0) place.fail("has neither fl_x nor a camera_angle_x between 0 and pi");
  double fy = frame.number("fl_y", 0);
  if (fy == 0) fy = !frame.find("fl_x") && angle_y > 0 && angle_y < M_PI ? height / 2.0 / std::tan(angle_y / 2) : fx;
  try {
    return lens_of_opencv_terms(
        {fx, fy, frame.number("cx", width / 2.0) - kNerfPixelCentre,
         frame.number("cy", height / 2.0) - kNerfPixelCentre},
        {frame.number("k1", 0), frame.number("k2", 0), frame.number("p1", 0), frame.number("p2", 0)});
  } catch (const Error& e) {
    place.fail(e.what());
  }
}

Camera parse_camera(const JsonValue& value, const JsonValue& file, const fs::path& directory) {
  Camera camera;
  const Frame frame(value, file);
  if (const auto path = value.find("file_path")) {
    fs::path name = path->text();
    std::error_code ignored;  // a name that can't be that of a file is left as it is
    if (!fs::exists(directory / name, ignored) && fs::exists(directory / (name.string() + ".png"), ignored))
      name += ".png";
    camera.image = (directory / name).lexically_normal().string();
    camera.name = name.stem().string();
  }
  const auto width = frame.find("w"), height = frame.find("h");
  if (width && height) {
    camera.width = static_cast<int>(width->integer(1, kMaxImageSize));
    camera.height = static_cast<int>(height->integer(1, kMaxImageSize));
  } else {
    if (camera.image.empty()) value.fail("has neither w and h nor a file_path");
    const ImageSize size = load_image_size(camera.image);
    camera.width = size.width;
    camera.height = size.height;
  }
  camera.lens = parse_lens(frame, value, camera.width, camera.height);
  RigidMotion motion = parse_rigid_motion(value.at("transform_matrix"));
  motion.rotation = turned(motion.rotation);
  camera.pose = pose_of_world_from_camera(motion);
  return camera;
}

Rig parse_nerf(const std::string& text, const std::string& path) {
  const nlohmann::json root = parse_json(text, path);
  const JsonValue file(root, path);
  Rig rig;
  const JsonValue frames = file.at("frames");
  for (const JsonValue& value : frames.elements()) {
    if (rig.cameras.size() == kMaxCameras) frames.fail("at most " + std::to_string(kMaxCameras) + " cameras");
    rig.cameras.push_back(parse_camera(value, file, fs::path(path).parent_path()));
    rig.cameras.back().id = static_cast<uint32_t>(rig.cameras.size()) - 1;
  }
  if (rig.cameras.empty()) frames.fail("must not be empty");
  return rig;
}

std::string nerf_text(const Rig& rig) {
  ordered_json frames = ordered_json::array();
  for (const Camera& camera : rig.cameras) {
    const Lens& lens = camera.lens;
    ordered_json frame = {{"file_path", camera.image.empty() ? camera.name : camera.image},
                          {"w", camera.width},
                          {"h", camera.height},
                          {"fl_x", lens.fx()},
                          {"fl_y", lens.fy()},
                          {"cx", lens.cx() + kNerfPixelCentre},
                          {"cy", lens.cy() + kNerfPixelCentre}};
    if (lens.has_distortion())
      frame.update(ordered_json{{"k1", lens.k1()}, {"k2", lens.k2()}, {"p1", lens.p1()}, {"p2", lens.p2()}});
    const Mat3 rotation = turned(camera.pose.rotation());
    ordered_json rows = ordered_json::array();
    for (int r = 0; r < 3; r++)
      rows.push_back({rotation[0][r], rotation[1][r], rotation[2][r], camera.pose.position[r]});
    rows.push_back({0, 0, 0, 1});
    frame["transform_matrix"] = rows;
    frames.push_back(frame);
  }
  std::string text = "{\"camera_model\": \"OPENCV\",\n \"frames\": [\n";
  for (size_t i = 0; i < frames.size(); i++) text += "  " + frames[i].dump() + (i + 1 < frames.size() ? ",\n" : "\n");
  return text + "]}\n";
}

}  // namespace

RigImport import_nerf(const std::string& path) { return {parse_nerf(read_text_file(path), path), {}}; }

RigExport export_nerf(const Rig& rig, const std::string& path) { return export_text(rig, path, nerf_text, parse_nerf); }

}  // namespace lf
