// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "rig/rig.h"

namespace lf {

// What rigs from and to other programs' files have in common.

struct RigImport {
  Rig rig;                         // directory "": image paths start at the current folder
  std::vector<std::string> notes;  // for people: what was assumed
};

struct RigExport {
  double max_error = 0;            // pixels: reprojection error of what was written against the rig
  std::vector<std::string> notes;  // for people: what the format can't hold
};

// What a format can hold beside lenses and poses.
struct FormatCapacity {
  bool images = true, names = true, ids = true;
};

// `written` is what a reader has of `rig`; the error is at the rig's own extent and far away.
RigExport describe_export(const Rig& rig, const Rig& written, const FormatCapacity& capacity);

// "Camera ID: what": for lenses and names that a format can't hold.
[[noreturn]] void refuse_camera(const Camera& camera, const std::string& what);

// How far apart two descriptions of the same cameras are, in pixels: the largest distance between where camera i of `b`
// and camera i of `a` see the same point, over 9 x 9 points of each image of `a`, at `distance` metres along the axis
// and far away. Infinity if the numbers of cameras differ or `b` does not see a point.
double max_reprojection_error(const Rig& a, const Rig& b, double distance);

}  // namespace lf
