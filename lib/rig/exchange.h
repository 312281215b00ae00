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

}  // namespace lf
