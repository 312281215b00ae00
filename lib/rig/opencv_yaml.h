// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

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

}  // namespace lf
