// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "rig/exchange.h"

namespace lf {

// NeRF's transforms.json as instant-ngp and nerfstudio read and write it. A camera is an element of "frames":
//   file_path, transform_matrix (4x4, world from camera; the camera's x right, y up, z back)
// with its lens there or, for all, at the top: camera_model (OPENCV, PINHOLE, SIMPLE_PINHOLE), fl_x, fl_y, cx, cy, w,
// h, k1, k2, p1, p2; or camera_angle_x (radians) alone. Pixels have their centres at (0.5, 0.5). The world stays as it
// is, in metres here: what a program scales or turns for itself ("scale", "offset", "applied_transform") is not looked
// at. All functions throw Error naming file and place.

// Other lens models and terms are refused. w and h that are not there are those of the image file, whose name may lack
// its ".png". A camera's name is the file's without folder and ending.
RigImport import_nerf(const std::string& path);
// Every frame has a lens of its own. Images are given relative to `path`.
RigExport export_nerf(const Rig& rig, const std::string& path);

}  // namespace lf
