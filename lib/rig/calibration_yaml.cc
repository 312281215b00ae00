// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "base/json_value.h"
#include "base/text.h"
#include "rig/exchange.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

constexpr int kDistortionSizes[] = {4, 5, 8, 12, 14};  // sizes that cv::calibrateCamera writes
constexpr size_t kFisheyeTerms = 4;                    // k1 k2 k3 k4
// Values of distortion_model and keys that mean OpenCV's fisheye lens.
const std::set<std::string_view> kFisheyeWords = {"equidistant", "fisheye", "fisheye_model"};

struct Matrix {
  int rows, columns;
  std::vector<double> data;
};

Matrix parse_matrix(const JsonValue& value) {
  Matrix matrix;
  matrix.rows = static_cast<int>(value.at("rows").integer(1, 100));
  matrix.columns = static_cast<int>(value.at("cols").integer(1, 100));
  matrix.data = parse_numbers(value.at("data"), static_cast<size_t>(matrix.rows) * matrix.columns);
  return matrix;
}

Matrix parse_matrix(const JsonValue& value, int rows, int columns) {
  Matrix matrix = parse_matrix(value);
  if (matrix.rows != rows || matrix.columns != columns)
    value.fail("must be " + std::to_string(rows) + "x" + std::to_string(columns));
  return matrix;
}

// Returns true for ROS' distortion_model equidistant and for fisheye_model 1 of OpenCV's calibration sample.
bool is_fisheye(const JsonValue& camera) {
  if (const auto flag = camera.find("fisheye_model")) return flag->number() != 0;
  const auto model = camera.find("distortion_model");
  return model && kFisheyeWords.contains(model->text());
}

// `place` is the camera matrix; `distortion_terms` are the coefficients, if there are any.
Lens parse_opencv_lens(const JsonValue& place, const std::optional<JsonValue>& distortion_terms, bool fisheye) {
  const auto pinhole = pinhole_of_matrix(parse_matrix(place, 3, 3).data);
  if (!pinhole)
    place.fail(std::string("must be [fx, 0, cx, 0, fy, cy, 0, 0, 1], because a rig cannot hold skew; ") +
               kUndistortRemedy);
  std::vector<double> distortion;
  if (const auto& value = distortion_terms) {
    const Matrix terms = parse_matrix(*value);
    distortion = terms.data;
    const int size = static_cast<int>(distortion.size());
    if ((terms.rows != 1 && terms.columns != 1) ||
        std::find(std::begin(kDistortionSizes), std::end(kDistortionSizes), size) == std::end(kDistortionSizes))
      value->fail("must be a row or a column of 4, 5, 8, 12 or 14 distortion coefficients");
    while (fisheye && distortion.size() > kFisheyeTerms && distortion.back() == 0) distortion.pop_back();
  }
  return lens_from_opencv(place, *pinhole, distortion, fisheye);
}

void parse_size(const JsonValue& value, Camera& camera) {
  const auto width = value.find("image_width"), height = value.find("image_height");
  if (width && height) return parse_image_size(*width, *height, camera);
  for (const char* key : {"image_size", "imageSize"})
    if (const auto size = value.find(key)) return parse_image_size(*size, camera);
  value.fail("the size of the pictures is missing; add image_width and image_height (pixels)");
}

// Returns the transform from world to camera coordinates, or nothing if the camera has neither R nor T. It is an error
// if only one of these keys is missing.
std::optional<RigidTransform> parse_motion(const JsonValue& value) {
  RigidTransform motion;
  const auto rotation = value.find("R"), translation = value.find("T");
  if (!rotation && !translation) return std::nullopt;
  if (rotation) {
    motion.rotation = nearest_rotation(matrix_of_rows(parse_matrix(*rotation, 3, 3).data), *rotation);
  }
  if (translation) {
    const std::vector<double> t = parse_matrix(*translation, 3, 1).data;
    motion.translation = Vec3(t[0], t[1], t[2]);
  }
  if (!rotation)
    value.fail(
        "has T but no R. Add R (3x3), the rotation from world to camera coordinates, or the identity matrix if "
        "the camera has the axes of the world");
  if (!translation)
    value.fail(
        "has R but no T. Add T (3x1), the translation from world to camera coordinates, or zeros if the camera "
        "is at the origin of the world");
  return motion;
}

class MissingDistortion {
 public:
  explicit MissingDistortion(bool is_expected) : is_expected_(is_expected) {}
  std::optional<JsonValue> find(const JsonValue& value, const char* key, const std::string& place) {
    const auto terms = value.find(key);
    if (terms) return terms;
    if (cameras_++ == 0) first_ = (place.empty() ? "" : place + ".") + key;
    return std::nullopt;
  }
  void add_note(std::vector<std::string>& notes) const {
    if (cameras_ == 0 || is_expected_) return;
    notes.push_back(first_ + (cameras_ > 1 ? " and " + std::to_string(cameras_ - 1) + " more are" : " is") +
                    " missing: the lens is treated as free of distortion");
  }

 private:
  const bool is_expected_;
  std::string first_;
  size_t cameras_ = 0;
};

// `place` is the path of the camera in the file, such as "cameras[2]", or "" for the top level.
Camera parse_camera(const JsonValue& value, const std::string& place, const fs::path& directory,
                    MissingDistortion& missing) {
  Camera camera;
  parse_size(value, camera);
  camera.lens = parse_opencv_lens(value.at("camera_matrix"), missing.find(value, "distortion_coefficients", place),
                                  is_fisheye(value));
  camera.pose = pose_of_camera_from_world(parse_motion(value).value_or(RigidTransform()));
  for (const char* key : {"camera_name", "name"})
    if (const auto name = value.find(key)) camera.name = name->text();
  if (const auto image = value.find("image")) camera.image = (directory / image->text()).lexically_normal().string();
  return camera;
}

const std::set<std::string_view> kOpenCvKeys = {
    // Keys that the importer reads.
    "cameras", "name", "camera_name", "image", "image_width", "image_height", "image_size", "imageSize",
    "camera_matrix", "distortion_coefficients", "R", "T", "rows", "cols", "data", "M1", "M2", "D1", "D2",
    // Keys without effect on a rig.
    "dt", "R1", "R2", "P1", "P2", "Q", "distortion_model", "camera_model", "calibration_time", "nframes",
    "nr_of_frames", "board_width", "board_height", "square_size", "marker_size", "aspectRatio", "flags",
    "avg_reprojection_error", "per_view_reprojection_errors", "extrinsic_parameters", "image_points", "grid_points",
    "rectification_matrix", "fisheye_model",
    // Keys of the multi-view calibration.
    "image_sizes", "Ks", "distortions", "Rs", "rvecs", "Ts", "cam_ids", "models", "is_fisheye", "rvecs0", "tvecs0",
    "errors_per_frame", "errors_per_camera", "output_pairs", "pattern_points", "detection_mask", "image_names",
    "sizes"};

// The first camera may lack R and T, and is then at the origin of the world, with the axes of the world. All other
// cameras need both keys.
void require_places(const std::vector<JsonValue>& cameras) {
  for (size_t i = 1; i < cameras.size(); i++) {
    const JsonValue& camera = cameras[i];
    if (camera.find("R") || camera.find("T")) continue;
    const bool has_vectors = camera.find("rvec") || camera.find("tvec");
    camera.fail(std::string("R (3x3) and T (3x1), which transform world points to the camera, are missing. Each camera "
                            "after the first needs both keys") +
                (has_vectors ? ". Write tvec as T, and compute R from rvec with cv::Rodrigues()" : ""));
  }
}

// Parses the two cameras of OpenCV's stereo sample, which writes R and T to extrinsics.yml.
std::vector<Camera> parse_stereo(const JsonValue& file, const fs::path& directory, bool undistorted,
                                 std::vector<std::string>& notes) {
  std::vector<Camera> cameras(2);
  for (Camera& camera : cameras) parse_size(file, camera);
  MissingDistortion missing(undistorted);
  cameras[0].lens = parse_opencv_lens(file.at("M1"), missing.find(file, "D1", ""), is_fisheye(file));
  cameras[1].lens = parse_opencv_lens(file.at("M2"), missing.find(file, "D2", ""), is_fisheye(file));
  missing.add_note(notes);
  std::optional<RigidTransform> second_from_first = parse_motion(file);
  if (!second_from_first) {
    std::string beside;
    for (const char* name : {"extrinsics.yml", "extrinsics.yaml"})
      if (std::error_code ignored; beside.empty() && fs::is_regular_file(directory / name, ignored))
        beside = (directory / name).string();
    if (beside.empty()) file.fail("R and T of the second camera are missing; copy them from the extrinsics file");
    const nlohmann::json root = parse_yaml(read_text_file(beside), beside);
    const JsonValue extrinsics(root, beside);
    for (const char* key : {"R", "T"}) extrinsics.at(key);  // both are required
    for (const std::string& note : check_foreign_keys(root, beside, kOpenCvKeys, kFisheyeWords)) notes.push_back(note);
    second_from_first = parse_motion(extrinsics);
    notes.push_back("R and T come from " + beside);
  }
  cameras[1].pose = pose_of_camera_from_world(*second_from_first);
  notes.push_back("the cameras are " + number_text(glm::length(cameras[1].pose.position)) +
                  " m apart, if the squares of the board were given in metres");
  return cameras;
}

// Removes all keys that describe distortion, which has no effect on undistorted pictures.
void remove_distortion(nlohmann::json& value) {
  if (value.is_object()) {
    for (const char* key : {"distortion_coefficients", "distortion_model", "camera_model", "fisheye_model", "D1", "D2",
                            "distortions", "models", "is_fisheye"})
      value.erase(key);
    if (value.contains("cameras")) remove_distortion(value["cameras"]);
  } else if (value.is_array()) {
    for (nlohmann::json& element : value) remove_distortion(element);
  }
}

RigImport parse_opencv_yaml(const std::string& text, const std::string& path, bool undistorted) {
  if (text.starts_with("<?xml"))
    throw Error(path +
                ": this is an XML file, but the importer reads YAML. Save it with the extension .yml, so that "
                "cv::FileStorage writes YAML");
  nlohmann::json root = parse_yaml(text, path);
  if (undistorted) remove_distortion(root);
  const JsonValue file(root, path);
  const fs::path directory = fs::path(path).parent_path();
  RigImport result;
  Rig& rig = result.rig;
  if (file.find("Ks")) {
    rig.cameras = parse_opencv_multiview(root, path, undistorted);
    root.erase("is_fisheye");
  }
  result.notes = check_foreign_keys(root, path, kOpenCvKeys, kFisheyeWords);
  MissingDistortion missing(undistorted);
  if (const auto cameras = file.find("cameras")) {
    const std::vector<JsonValue> values = cameras->elements();
    if (values.empty() || values.size() > kMaxCameras)
      cameras->fail("must be a list of 1 to " + std::to_string(kMaxCameras) + " cameras");
    require_places(values);
    for (size_t i = 0; i < values.size(); i++)
      rig.cameras.push_back(parse_camera(values[i], "cameras[" + std::to_string(i) + "]", directory, missing));
  } else if (file.find("M1") || file.find("M2")) {
    rig.cameras = parse_stereo(file, directory, undistorted, result.notes);
  } else if (rig.cameras.empty()) {
    if (!file.find("camera_matrix"))
      file.fail(
          "has none of the keys cameras, camera_matrix (OpenCV's calibration sample, ROS), M1 (OpenCV's stereo "
          "sample) and Ks (OpenCV's multi-view calibration); write the camera as camera_matrix, "
          "distortion_coefficients, image_width and image_height");
    rig.cameras.push_back(parse_camera(file, "", directory, missing));
  }
  missing.add_note(result.notes);
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    rig.cameras[i].id = static_cast<uint32_t>(i);
    if (rig.cameras[i].name.empty()) rig.cameras[i].name = "cam_" + std::to_string(i);
  }
  return result;
}

std::string opencv_yaml_text(const Rig& rig) {
  cv::FileStorage file(".yaml", cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
  file << "cameras"
       << "[";
  for (const Camera& camera : rig.cameras) {
    const Lens& lens = camera.lens;
    const RigidTransform motion = camera_from_world(camera.pose);
    file << "{"
         << "name" << camera.name;
    if (!camera.image.empty()) file << "image" << camera.image;
    file << "image_width" << camera.width << "image_height" << camera.height;
    file << "camera_matrix" << cv::Mat_<double>({3, 3}, {lens.fx(), 0, lens.cx(), 0, lens.fy(), lens.cy(), 0, 0, 1});
    if (lens.distortion().fisheye)
      file << "distortion_model"
           << "equidistant";
    file << "distortion_coefficients" << cv::Mat_<double>(opencv_terms(camera), true);
    cv::Mat_<double> r(3, 3), t(3, 1);
    for (int row = 0; row < 3; row++) {
      for (int column = 0; column < 3; column++) r(row, column) = motion.rotation[column][row];
      t(row) = motion.translation[row];
    }
    file << "R" << r << "T" << t << "}";
  }
  file << "]";
  return file.releaseAndGetString();
}

constexpr char kTopicEnd[] = "/image_raw";

std::string name_of_topic(std::string topic) {
  if (topic.ends_with(kTopicEnd)) topic.resize(topic.size() - std::size(kTopicEnd) + 1);
  if (topic.starts_with("/")) topic.erase(0, 1);
  return topic;
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
  require(model, {"radtan", "equidistant", "none"});
  const JsonValue place = camera.at("intrinsics");
  const std::vector<double> k = parse_numbers(place);
  if (k.size() != 4)
    place.fail(std::string("must be [fx, fy, cx, cy]") +
               (k.size() == 8 ? ", but has 8 numbers. Write decimals with a point, not with a comma" : ""));
  std::vector<double> distortion;
  const bool fisheye = model.text() == "equidistant";
  if (model.text() != "none") {
    const JsonValue terms = camera.at("distortion_coeffs");
    distortion = parse_numbers(terms);
    if (distortion.size() != 4) terms.fail(fisheye ? "must be [k1, k2, k3, k4]" : "must be [k1, k2, p1, p2]");
  }
  return lens_from_opencv(place, {k[0], k[1], k[2], k[3]}, distortion, fisheye);
}

std::map<uint32_t, std::string> find_cameras(const nlohmann::json& root, const JsonValue& file) {
  std::map<uint32_t, std::string> cameras;
  if (!root.is_object()) return cameras;
  for (const auto& [key, value] : root.items()) {
    if (!key.starts_with("cam")) continue;
    const auto number = number_of_text<uint32_t>(std::string_view(key).substr(3));
    if (!number) continue;
    const auto [other, is_new] = cameras.emplace(*number, key);
    if (!is_new)
      file.fail(other->second + " and " + key +
                " have the same number, but every camera needs its own; rename one of them");
  }
  if (cameras.size() > kMaxCameras)
    file.fail("has too many cameras; a rig has at most " + std::to_string(kMaxCameras) + " cameras");
  return cameras;
}

// Returns the pose of the camera (world from camera), relative to the IMU or to the camera with the previous number.
// `before` is the latter, or null if it is missing.
RigidTransform place_of(const JsonValue& camera, const RigidTransform* before, uint32_t number, bool is_first) {
  const auto step = camera.find("T_cn_cnm1"), from_imu = camera.find("T_cam_imu"), to_imu = camera.find("T_imu_cam");
  if (step && before) return *before * parse_rigid_transform(*step).inverse();
  if (from_imu) return parse_rigid_transform(*from_imu).inverse();
  if (to_imu) return parse_rigid_transform(*to_imu);
  if (step)
    step->fail("is relative to cam" + std::to_string(number - 1) +
               ", which the file does not have; add that camera, or T_cam_imu to this one");
  if (!is_first) camera.at("T_cn_cnm1");  // reports the missing key
  return {};
}

// Compares the pose from the chain of cameras with the camera's own pose relative to the IMU, if the file has both
// poses.
void check_imu_pose(const JsonValue& camera, const std::string& name, const RigidTransform& place,
                    std::vector<std::string>& notes) {
  constexpr double kMaxMetres = 0.002, kMaxDegrees = 0.5;  // more than rounding to 4 digits
  const auto from_imu = camera.find("T_cam_imu"), to_imu = camera.find("T_imu_cam");
  if (!camera.find("T_cn_cnm1") || (!from_imu && !to_imu)) return;
  const RigidTransform other = from_imu ? parse_rigid_transform(*from_imu).inverse() : parse_rigid_transform(*to_imu);
  const RigidTransform difference = other.inverse() * place;
  const Mat3& turn = difference.rotation;
  const double cosine = (turn[0][0] + turn[1][1] + turn[2][2] - 1) / 2;
  const double metres = glm::length(difference.translation);
  const double degrees = std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / M_PI;
  if (metres <= kMaxMetres && degrees <= kMaxDegrees) return;
  notes.push_back(name + ": T_cn_cnm1 contradicts " + (from_imu ? "T_cam_imu" : "T_imu_cam") +
                  format_text(" by %.3g m and %.3g degrees. The pose is that of T_cn_cnm1", metres, degrees));
}

RigImport parse_kalibr(const std::string& text, const std::string& path) {
  const nlohmann::json root = parse_yaml(text, path);
  const JsonValue file(root, path);
  const std::map<uint32_t, std::string> cameras = find_cameras(root, file);
  if (cameras.empty()) file.at("cam0");  // reports the missing key
  std::set<std::string_view> known = {"cam_overlaps", "camera_model", "distortion_coeffs", "distortion_model",
                                      "intrinsics",   "resolution",   "rostopic",          "T_cam_imu",
                                      "T_cn_cnm1",    "T_imu_cam",    "timeshift_cam_imu"};
  for (const auto& [number, key] : cameras) known.insert(key);
  RigImport result;
  result.notes = check_foreign_keys(root, path, known, {"equidistant"});
  std::map<uint32_t, RigidTransform> places;
  bool has_imu = false;  // positions are relative to the IMU
  for (const auto& [number, key] : cameras) {
    const JsonValue value = file.at(key.c_str());
    Camera camera;
    camera.id = number;
    camera.lens = parse_kalibr_lens(value);
    parse_image_size(value.at("resolution"), camera);
    camera.name = key;
    if (const auto topic = value.find("rostopic")) camera.name = name_of_topic(topic->text());
    // Kalibr: IMU time = camera time + shift.
    if (const auto shift = value.find("timeshift_cam_imu")) camera.time_offset = shift->number();
    const auto before = number > 0 ? places.find(number - 1) : places.end();
    const RigidTransform place =
        place_of(value, before != places.end() ? &before->second : nullptr, number, places.empty());
    if (before != places.end() && has_imu) check_imu_pose(value, key, place, result.notes);
    has_imu = has_imu || value.find("T_cam_imu") || value.find("T_imu_cam");
    places.emplace(number, place);
    camera.pose = pose_of_world_from_camera(place);
    result.rig.cameras.push_back(camera);
  }
  return result;
}

std::string kalibr_text(const Rig& rig) {
  std::string text;
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    const Camera& camera = rig.cameras[i];
    const Lens& lens = camera.lens;
    const RigidTransform here = camera_from_world(camera.pose);
    const auto line = [&](const char* key, const std::string& value) {
      text += std::string("  ") + key + ": " + value + "\n";
    };
    text += "cam" + std::to_string(i) + ":\n";
    if (i > 0) {
      // Subtract positions first, to keep precision far from the origin.
      const Pose& before = rig.cameras[i - 1].pose;
      const RigidTransform step = {here.rotation * before.rotation(),
                                   here.rotation * (before.position - camera.pose.position)};
      line("T_cn_cnm1", rigid_transform_text(step));
    } else {
      line("T_cam_imu", rigid_transform_text(here));
    }
    line("camera_model", "pinhole");
    line("intrinsics", number_list_text(PinholeParams{lens.fx(), lens.fy(), lens.cx(), lens.cy()}));
    const std::vector<double> terms = opencv_terms(camera);
    if (terms.size() != 4) throw_camera_error(camera, "Kalibr cannot hold distortion terms beyond k1, k2, p1 and p2");
    line("distortion_model", lens.distortion().fisheye ? "equidistant" : "radtan");
    line("distortion_coeffs", number_list_text(terms));
    line("resolution", "[" + std::to_string(camera.width) + ", " + std::to_string(camera.height) + "]");
    line("rostopic", nlohmann::json("/" + camera.name + kTopicEnd).dump());
    if (camera.time_offset != 0) line("timeshift_cam_imu", yaml_number(camera.time_offset));
  }
  return text;
}

}  // namespace

RigImport import_opencv_yaml(const std::string& path, bool undistorted) {
  return with_topology(parse_opencv_yaml(read_text_file(path), path, undistorted));
}

RigExport export_opencv_yaml(const Rig& rig, const std::string& path) {
  return export_text(rig, path, opencv_yaml_text, [](const std::string& text, const std::string& name) {
    return parse_opencv_yaml(text, name, false);
  });
}

RigImport import_kalibr(const std::string& path) { return with_topology(parse_kalibr(read_text_file(path), path)); }

RigExport export_kalibr(const Rig& rig, const std::string& path) {
  const std::string text = kalibr_text(rig);
  const RigExport result =
      describe_export(rig, parse_kalibr(text, path).rig, {.images = false, .ids = false, .time_offsets = true});
  write_text_file(text, path);
  return result;
}

}  // namespace lf
