// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "rig/exchange.h"

namespace lf {

// Kalibr's camchain.yaml (https://github.com/ethz-asl/kalibr/wiki/yaml-formats): cam0, cam1, ..., each with
//   camera_model: pinhole; intrinsics: [fx, fy, cx, cy]; distortion_model: radtan (k1 k2 p1 p2) or none;
//   distortion_coeffs; resolution: [width, height]; rostopic;
//   T_cn_cnm1 (from cam1 on): camera n from camera n - 1, metres; T_cam_imu: camera from the body's frame.
// Pixels and axes as ours. All functions throw Error naming file and place.

// Other models (omni, eucm, ds; equidistant, fov) are refused: no lens of ours equals them. The world is the IMU's
// frame where cam0 has T_cam_imu, else cam0's. A camera's name is its topic without a leading "/" and a trailing
// "/image_raw".
RigImport import_kalibr(const std::string& path);
// T_cam_imu carries the rig's world. Kalibr has no place for ids, images and sources.
RigExport export_kalibr(const Rig& rig, const std::string& path);

}  // namespace lf
