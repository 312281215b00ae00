// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <string>
#include <vector>

#include "base/json_value.h"
#include "geometry/lens.h"
#include "geometry/pose.h"
#include "rig/exchange.h"

namespace lf {

// OpenCV's FileStorage in YAML, with the key names of its calibration samples. One entry per camera:
//   cameras:
//      -
//         name: cam_00_00
//         image: cam_00_00.png                            # optional, from the folder of the file
//         image_width: 320
//         image_height: 240
//         camera_matrix: !!opencv-matrix                  # 3x3: fx 0 cx, 0 fy cy, 0 0 1
//         distortion_coefficients: !!opencv-matrix        # k1 k2 p1 p2 [k3 ...], a row or a column of 4, 5, 8, 12 or
//         14 R: !!opencv-matrix                              # 3x3, X_camera = R X_world + T, metres T: !!opencv-matrix
//         # 3x1
// Pixels as ours: (0, 0) is the centre of the top-left one. A file with camera_matrix at the top, as
// cv::calibrateCamera samples write them, is one camera at the origin. All functions throw Error naming file and place.

// Terms beyond p2 must be 0: no lens of ours has them. R and T default to none.
RigImport import_opencv_yaml(const std::string& path);
RigExport export_opencv_yaml(const Rig& rig, const std::string& path);

// Lenses and poses in the terms that OpenCV, Kalibr and NeRF files share.

// fx, fy, cx, cy.
using FocalAndCentre = std::array<double, 4>;

// The lens with `distortion` k1, k2, p1, p2 (fewer: the rest is 0), under the shortest of our model names that holds
// it. (0, 0) is the centre of the top-left pixel. Throws Error.
Lens lens_of_opencv_terms(const FocalAndCentre& pinhole, const std::vector<double>& distortion);

// A rotation with what comes after it: x -> rotation x + translation.
struct RigidMotion {
  Mat3 rotation{1};
  Vec3 translation{0, 0, 0};

  Vec3 operator()(const Vec3& x) const { return rotation * x + translation; }
  RigidMotion operator*(const RigidMotion& first) const;  // `first`, then this
  RigidMotion inverse() const;
};

RigidMotion camera_from_world(const Pose& pose);
Pose pose_of_camera_from_world(const RigidMotion& motion);
Pose pose_of_world_from_camera(const RigidMotion& motion);

// The rotation nearest to `matrix`. `value` fails if that is farther than the rounding of a file of 4 digits.
Mat3 nearest_rotation(const Mat3& matrix, const JsonValue& value);
// [[r, r, r, t], ...]: 3 rows, or 4 with 0 0 0 1.
RigidMotion parse_rigid_motion(const JsonValue& rows);
// As text that is JSON and YAML at once, with a fourth row.
std::string rigid_motion_text(const RigidMotion& motion);

}  // namespace lf
