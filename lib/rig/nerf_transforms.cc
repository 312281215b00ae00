// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "base/text.h"
#include "image/image_file.h"

namespace lf {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr double kNerfPixelCentre = 0.5;  // NeRF's centre of the top-left pixel

// Converts between NeRF's axes (y up, z back) and rig axes, in both directions.
Mat3 turned(const Mat3& rotation) { return {rotation[0], -rotation[1], -rotation[2]}; }

// A frame. If a key is missing, the value at the top level of the file applies.
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

constexpr char kFisheyeModel[] = "OPENCV_FISHEYE";

bool is_fisheye(const Frame& frame) {
  const auto flag = frame.find("is_fisheye"), model = frame.find("camera_model");
  return (flag && flag->flag()) || (model && model->text() == kFisheyeModel);
}

// Returns the terms in OpenCV's order, from separate keys or from nerfstudio's distortion_params [k1, k2, k3, k4, p1,
// p2]. The terms are k1 k2 k3 k4 for a fisheye lens, otherwise k1 k2 p1 p2 k3.
std::vector<double> distortion_of(const Frame& frame, bool fisheye) {
  std::vector<double> k;
  if (const auto params = frame.find("distortion_params")) {
    k = parse_numbers(*params, 6);
  } else {
    for (const char* key : {"k1", "k2", "k3", "k4", "p1", "p2"}) k.push_back(frame.number(key, 0));
  }
  if (fisheye && (k[4] != 0 || k[5] != 0))
    throw Error(std::string("a fisheye lens must have p1 = p2 = 0; ") + kUndistortRemedy);
  if (fisheye) return {k[0], k[1], k[2], k[3]};
  if (k[3] != 0) throw Error(std::string("k4 must be 0, because a rig cannot hold this term; ") + kUndistortRemedy);
  return {k[0], k[1], k[4], k[5], k[2]};
}

Lens parse_lens(const Frame& frame, const JsonValue& place, int width, int height) {
  double fx = frame.number("fl_x", 0);
  const double angle_x = frame.number("camera_angle_x", 0), angle_y = frame.number("camera_angle_y", 0);
  if (fx == 0 && angle_x > 0 && angle_x < M_PI) fx = width / 2.0 / std::tan(angle_x / 2);
  if (fx == 0)
    place.fail(frame.find("fl_x") ? "fl_x is 0; give the focal length in pixels"
                                  : "has neither fl_x nor a camera_angle_x between 0 and pi");
  double fy = frame.number("fl_y", 0);
  if (fy == 0) fy = !frame.find("fl_x") && angle_y > 0 && angle_y < M_PI ? height / 2.0 / std::tan(angle_y / 2) : fx;
  try {
    const bool fisheye = is_fisheye(frame);
    const double cx = frame.number("cx", width / 2.0), cy = frame.number("cy", height / 2.0);
    const PinholeParams pinhole{fx, fy, cx - kNerfPixelCentre, cy - kNerfPixelCentre};
    const std::vector<double> distortion = distortion_of(frame, fisheye);
    return fisheye ? lens_from_opencv_fisheye(pinhole, distortion) : lens_from_opencv(pinhole, distortion);
  } catch (const Error& e) {
    place.fail(e.what());
  }
}

class AppliedTransform {
 public:
  AppliedTransform(const JsonValue& file, std::vector<std::string>& notes) {
    const auto motion = file.find("applied_transform"), scale = file.find("applied_scale");
    if (motion) undo_ = parse_rigid_transform(*motion).inverse();
    if (scale) scale_ = scale->number();
    if (scale && !(scale_ > 0)) scale->fail("must be positive");
    if (motion || scale_ != 1)
      notes.push_back(std::string("positions and axes are those before ") + (motion ? "applied_transform" : "") +
                      (motion && scale_ != 1 ? " and " : "") + (scale_ != 1 ? "applied_scale" : ""));
  }
  RigidTransform undone(RigidTransform world_from_camera) const {
    world_from_camera.translation /= scale_;
    return undo_ * world_from_camera;
  }

 private:
  RigidTransform undo_;
  double scale_ = 1;
};

fs::path file_of(const fs::path& directory, const std::string& name) {
  std::error_code ignored;  // invalid names are returned unchanged
  if (fs::exists(directory / name, ignored)) return name;
  if (fs::exists(directory / (name + ".png"), ignored)) return name + ".png";
  std::string slashes = name;
  std::replace(slashes.begin(), slashes.end(), '\\', '/');
  return slashes != name && fs::exists(directory / slashes, ignored) ? slashes : name;
}

Camera parse_camera(const JsonValue& value, const JsonValue& file, const fs::path& directory,
                    const AppliedTransform& applied) {
  Camera camera;
  const Frame frame(value, file);
  if (const auto path = value.find("file_path")) {
    const fs::path name = file_of(directory, path->text());
    camera.image = (directory / name).lexically_normal().string();
    camera.name = name.stem().string();
  }
  const auto width = frame.find("w"), height = frame.find("h");
  if (width && height) {
    parse_image_size(*width, *height, camera);
  } else {
    if (camera.image.empty()) value.fail("has neither w and h nor a file_path, so the image size is unknown");
    const ImageSize size = load_image_size(camera.image);
    camera.width = size.width;
    camera.height = size.height;
  }
  camera.lens = parse_lens(frame, value, camera.width, camera.height);
  RigidTransform motion = applied.undone(parse_rigid_transform(value.at("transform_matrix")));
  motion.rotation = turned(motion.rotation);
  camera.pose = pose_of_world_from_camera(motion);
  return camera;
}

// Frames with different times come from one moving camera, or show several instants of an array.
class SingleTimeCheck {
 public:
  void add(const JsonValue& frame) {
    const auto time = frame.find("time");
    if (!time) return;
    if (!first_) first_ = time->number();
    if (time->number() != *first_)
      time->fail("is " + number_text(time->number()) + ", but an earlier frame has " + number_text(*first_) +
                 ". A rig describes one instant, so keep only the frames of one time");
  }

 private:
  std::optional<double> first_;
};

// Masks and depths appear in the note.
const std::set<std::string_view> kNerfKeys = {
    // Keys that the importer reads.
    "frames", "file_path", "transform_matrix", "camera_model", "fl_x", "fl_y", "cx", "cy", "w", "h", "k1", "k2", "p1",
    "p2", "k3", "k4", "camera_angle_x", "camera_angle_y", "distortion_params", "applied_transform", "applied_scale",
    "time", "is_fisheye",
    // Keys without effect on a rig.
    "aabb", "aabb_scale", "render_aabb", "scale", "offset", "up", "sharpness", "rotation", "colmap_im_id",
    "ply_file_path", "orientation_override", "train_filenames", "val_filenames", "test_filenames", "white_transparent",
    "black_transparent", "integer_depth_scale", "enable_depth_loading", "n_extra_learnable_dims"};

// Adds a note for each coefficient that only some frames have. Frames without the coefficient use 0.
void note_missing_coefficients(const JsonValue& file, const std::vector<JsonValue>& frames,
                               std::vector<std::string>& notes) {
  for (const char* key : {"k1", "k2", "p1", "p2", "k3", "k4", "distortion_params"}) {
    if (file.find(key)) continue;
    const auto missing = std::ranges::count_if(frames, [&](const JsonValue& frame) { return !frame.find(key); });
    if (missing > 0 && static_cast<size_t>(missing) < frames.size())
      notes.push_back(std::to_string(missing) + " of " + std::to_string(frames.size()) + " frames have no " + key +
                      ". The importer sets it to 0 there");
  }
}

RigImport parse_nerf(const std::string& text, const std::string& path) {
  const nlohmann::json root = parse_json(text, path);
  const JsonValue file(root, path);
  RigImport result;
  result.has_unit = false;
  const JsonValue frames = file.at("frames");
  const std::vector<JsonValue> values = frames.elements();
  if (values.empty()) frames.fail("must not be empty");
  if (values.size() > kMaxCameras)
    frames.fail("has too many frames; a rig has at most " + std::to_string(kMaxCameras) + " cameras");
  result.notes = check_foreign_keys(root, path, kNerfKeys, {"opencv_fisheye", "is_fisheye", "k3", "k4"});
  note_missing_coefficients(file, values, result.notes);
  const AppliedTransform applied(file, result.notes);
  SingleTimeCheck instant;
  for (const JsonValue& value : values) {
    instant.add(value);
    add_camera(parse_camera(value, file, fs::path(path).parent_path(), applied), result);
  }
  return result;
}

// Adds the distortion terms of a lens to a frame. The camera model is common to all frames.
void put_distortion(const Camera& camera, bool fisheye, ordered_json& frame) {
  const Lens& lens = camera.lens;
  if (!lens.has_distortion() && !fisheye) return;
  if (lens.distortion().fisheye != fisheye)
    throw_camera_error(camera, "the format cannot hold fisheye lenses beside other lenses");
  std::vector<double> terms = opencv_terms(camera);
  if (fisheye) {
    frame.update(ordered_json{{"k1", terms[0]}, {"k2", terms[1]}, {"k3", terms[2]}, {"k4", terms[3]}});
    return;
  }
  terms.resize(8);
  if (lens.distortion().is_rational) throw_camera_error(camera, "the format cannot hold the terms k4, k5 and k6");
  frame.update(ordered_json{{"k1", terms[0]}, {"k2", terms[1]}, {"p1", terms[2]}, {"p2", terms[3]}});
  if (terms[4] != 0) frame["k3"] = terms[4];
}

std::string nerf_text(const Rig& rig) {
  const bool fisheye = !rig.cameras.empty() && rig.cameras.front().lens.distortion().fisheye;
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
    put_distortion(camera, fisheye, frame);
    const Mat3 rotation = turned(camera.pose.rotation());
    ordered_json rows = ordered_json::array();
    for (int r = 0; r < 3; r++)
      rows.push_back({rotation[0][r], rotation[1][r], rotation[2][r], camera.pose.position[r]});
    rows.push_back({0, 0, 0, 1});
    frame["transform_matrix"] = rows;
    frames.push_back(frame);
  }
  std::string text =
      std::string("{\"camera_model\": \"") + (fisheye ? kFisheyeModel : "OPENCV") + "\",\n \"frames\": [\n";
  for (size_t i = 0; i < frames.size(); i++) text += "  " + frames[i].dump() + (i + 1 < frames.size() ? ",\n" : "\n");
  return text + "]}\n";
}

}  // namespace

RigImport import_nerf(const std::string& path) { return with_topology(parse_nerf(read_text_file(path), path)); }

RigExport export_nerf(const Rig& rig, const std::string& path) { return export_text(rig, path, nerf_text, parse_nerf); }

}  // namespace lf
