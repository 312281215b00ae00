// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"

#include <algorithm>
#include <filesystem>

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "base/error.h"
#include "base/json_value.h"
#include "base/yaml_value.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

constexpr int kDistortionSizes[] = {4, 5, 8, 12, 14};  // those of cv::calibrateCamera
constexpr int kOurTerms = 4;                           // k1 k2 p1 p2

struct Matrix {
  int rows, columns;
  std::vector<double> data;  // row by row
};

Matrix parse_matrix(const JsonValue& value) {
  Matrix matrix;
  matrix.rows = static_cast<int>(value.at("rows").integer(1, 100));
  matrix.columns = static_cast<int>(value.at("cols").integer(1, 100));
  for (const JsonValue& element : value.at("data").elements(static_cast<size_t>(matrix.rows) * matrix.columns))
    matrix.data.push_back(element.number());
  return matrix;
}

Matrix parse_matrix(const JsonValue& value, int rows, int columns) {
  Matrix matrix = parse_matrix(value);
  if (matrix.rows != rows || matrix.columns != columns)
    value.fail("must be " + std::to_string(rows) + "x" + std::to_string(columns));
  return matrix;
}

Lens parse_opencv_lens(const JsonValue& camera) {
  const JsonValue place = camera.at("camera_matrix");
  const std::vector<double> k = parse_matrix(place, 3, 3).data;
  if (k[1] != 0 || k[3] != 0 || k[6] != 0 || k[7] != 0 || k[8] != 1)
    place.fail("must be [fx, 0, cx, 0, fy, cy, 0, 0, 1]");
  std::vector<double> distortion;
  if (const auto value = camera.find("distortion_coefficients")) {
    const Matrix terms = parse_matrix(*value);
    distortion = terms.data;
    const int size = static_cast<int>(distortion.size());
    if ((terms.rows != 1 && terms.columns != 1) ||
        std::find(std::begin(kDistortionSizes), std::end(kDistortionSizes), size) == std::end(kDistortionSizes))
      value->fail("must be a row or a column of 4, 5, 8, 12 or 14 numbers");
    for (int i = kOurTerms; i < size; i++)
      if (distortion[i] != 0) {
        const std::string term = i == kOurTerms ? "k3" : "term " + std::to_string(i);
        value->fail(term + " is not 0, and no lens of ours has it; calibrate with k1, k2, p1, p2 alone");
      }
  }
  try {
    return lens_of_opencv_terms({k[0], k[4], k[2], k[5]}, distortion);
  } catch (const Error& e) {
    place.fail(e.what());
  }
}

Camera parse_camera(const JsonValue& value, const fs::path& directory) {
  Camera camera;
  camera.width = static_cast<int>(value.at("image_width").integer(1, kMaxImageSize));
  camera.height = static_cast<int>(value.at("image_height").integer(1, kMaxImageSize));
  camera.lens = parse_opencv_lens(value);
  RigidMotion motion;
  if (const auto rotation = value.find("R")) {
    const std::vector<double> r = parse_matrix(*rotation, 3, 3).data;
    motion.rotation =
        nearest_rotation(glm::transpose(Mat3(r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8])), *rotation);
  }
  if (const auto translation = value.find("T")) {
    const std::vector<double> t = parse_matrix(*translation, 3, 1).data;
    motion.translation = Vec3(t[0], t[1], t[2]);
  }
  camera.pose = pose_of_camera_from_world(motion);
  if (const auto name = value.find("name")) camera.name = name->text();
  if (const auto image = value.find("image")) camera.image = (directory / image->text()).lexically_normal().string();
  return camera;
}

Rig parse_opencv_yaml(const std::string& text, const std::string& path) {
  const nlohmann::json root = parse_yaml(text, path);
  const JsonValue file(root, path);
  const fs::path directory = fs::path(path).parent_path();
  Rig rig;
  if (const auto cameras = file.find("cameras")) {
    for (const JsonValue& value : cameras->elements()) rig.cameras.push_back(parse_camera(value, directory));
    if (rig.cameras.empty() || rig.cameras.size() > kMaxCameras)
      cameras->fail("must be 1 to " + std::to_string(kMaxCameras) + " cameras");
  } else {
    rig.cameras.push_back(parse_camera(file, directory));
  }
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    rig.cameras[i].id = static_cast<uint32_t>(i);
    if (rig.cameras[i].name.empty()) rig.cameras[i].name = "cam_" + std::to_string(i);
  }
  return rig;
}

std::string opencv_yaml_text(const Rig& rig) {
  cv::FileStorage file(".yaml", cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
  file << "cameras"
       << "[";
  for (const Camera& camera : rig.cameras) {
    const Lens& lens = camera.lens;
    const RigidMotion motion = camera_from_world(camera.pose);
    file << "{"
         << "name" << camera.name;
    if (!camera.image.empty()) file << "image" << camera.image;
    file << "image_width" << camera.width << "image_height" << camera.height;
    file << "camera_matrix" << cv::Mat_<double>({3, 3}, {lens.fx(), 0, lens.cx(), 0, lens.fy(), lens.cy(), 0, 0, 1});
    file << "distortion_coefficients" << cv::Mat_<double>({4, 1}, {lens.k1(), lens.k2(), lens.p1(), lens.p2()});
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

}  // namespace

RigImport import_opencv_yaml(const std::string& path) { return {parse_opencv_yaml(read_text_file(path), path), {}}; }

RigExport export_opencv_yaml(const Rig& rig, const std::string& path) {
  return export_text(rig, path, opencv_yaml_text, parse_opencv_yaml);
}

namespace {

constexpr double kRotationTolerance = 1e-3;  // an element of R^T R; angles are then good to half of that

}  // namespace

Lens lens_of_opencv_terms(const FocalAndCentre& pinhole, const std::vector<double>& distortion) {
  const auto [fx, fy, cx, cy] = pinhole;
  const auto term = [&](size_t i) { return i < distortion.size() ? distortion[i] : 0.0; };
  const double k1 = term(0), k2 = term(1), p1 = term(2), p2 = term(3);
  const bool radial = k1 != 0 || k2 != 0;
  if (p1 != 0 || p2 != 0 || (radial && fx != fy)) return Lens(LensModel::kOpenCv, {fx, fy, cx, cy, k1, k2, p1, p2});
  if (fx != fy) return Lens(LensModel::kPinhole, {fx, fy, cx, cy});
  if (!radial) return Lens::pinhole(fx, cx, cy);
  if (k2 == 0) return Lens(LensModel::kSimpleRadial, {fx, cx, cy, k1});
  return Lens(LensModel::kRadial, {fx, cx, cy, k1, k2});
}

RigidMotion RigidMotion::operator*(const RigidMotion& first) const {
  return {rotation * first.rotation, (*this)(first.translation)};
}

RigidMotion RigidMotion::inverse() const {
  const Mat3 back = glm::transpose(rotation);
  return {back, -(back * translation)};
}

RigidMotion camera_from_world(const Pose& pose) { return RigidMotion{pose.rotation(), pose.position}.inverse(); }

Pose pose_of_camera_from_world(const RigidMotion& motion) { return pose_of_world_from_camera(motion.inverse()); }

Pose pose_of_world_from_camera(const RigidMotion& motion) {
  return {motion.translation, glm::normalize(glm::quat_cast(motion.rotation))};
}

Mat3 nearest_rotation(const Mat3& matrix, const JsonValue& value) {
  const Mat3 square = glm::transpose(matrix) * matrix;
  double error = 0;
  for (int c = 0; c < 3; c++)
    for (int r = 0; r < 3; r++) error = std::max(error, std::abs(square[c][r] - (c == r)));
  if (!(error <= kRotationTolerance) || glm::determinant(matrix) < 0)
    value.fail("must be a rotation (orthonormal, right-handed)");
  // One Newton step of the polar decomposition squares the error; more only where a file is rounded.
  Mat3 rotation = matrix;
  for (int i = 0; i < 4 && error > 1e-15; i++, error *= error)
    rotation = (rotation + glm::transpose(glm::inverse(rotation))) * 0.5;
  return rotation;
}

RigidMotion parse_rigid_motion(const JsonValue& rows) {
  const std::vector<JsonValue> lines = rows.elements();
  if (lines.size() != 3 && lines.size() != 4) rows.fail("must have 3 or 4 rows");
  Mat3 matrix;
  RigidMotion motion;
  for (int r = 0; r < static_cast<int>(lines.size()); r++) {
    const std::vector<JsonValue> row = lines[r].elements(4);
    for (int c = 0; c < 4; c++) {
      const double x = row[c].number();
      if (r == 3 && x != (c == 3)) lines[r].fail("must be [0, 0, 0, 1]");
      if (r < 3 && c < 3) matrix[c][r] = x;
      if (r < 3 && c == 3) motion.translation[r] = x;
    }
  }
  motion.rotation = nearest_rotation(matrix, rows);
  return motion;
}

std::string rigid_motion_text(const RigidMotion& motion) {
  std::string text = "[";
  for (int r = 0; r < 3; r++) {
    text += "[";
    for (int c = 0; c < 3; c++) text += yaml_number(motion.rotation[c][r]) + ", ";
    text += yaml_number(motion.translation[r]) + "], ";
  }
  return text + "[0.0, 0.0, 0.0, 1.0]]";
}

}  // namespace lf
