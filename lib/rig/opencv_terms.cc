// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/opencv_terms.h"

#include <algorithm>

#include "base/yaml_value.h"

namespace lf {
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
