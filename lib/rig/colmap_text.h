// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "base/vec.h"

namespace lf {

// The text files of a COLMAP model (https://colmap.github.io/format.html), with the numbers as they stand there:
// COLMAP's conventions, not ours. See import_colmap() for a rig.

struct ColmapCamera {
  std::string model;           // any of COLMAP's
  int width = 0, height = 0;   // pixels, 1..kMaxImageSize
  std::vector<double> params;  // as many numbers as the model takes: `num_focal` focal lengths, cx, cy, distortion
  size_t num_focal = 1;
};

struct ColmapImage {
  uint32_t id = 0, camera_id = 0;
  Quat q{1, 0, 0, 0};  // camera_from_world, of unit norm
  Vec3 t{0, 0, 0};     // camera_from_world
  std::string name;    // name of the image file; may have spaces and folders
};

// Reads cameras.txt; cameras by CAMERA_ID. Throws Error naming file and line.
std::map<uint32_t, ColmapCamera> read_colmap_cameras(const std::string& path);
// Reads images.txt, in the order of the file; 2D points are checked for form and dropped. Throws Error naming file and
// line.
std::vector<ColmapImage> read_colmap_images(const std::string& path, const std::map<uint32_t, ColmapCamera>& cameras);

// Numbers are written so that they read back as the same numbers.
std::string colmap_cameras_text(const std::map<uint32_t, ColmapCamera>& cameras);
std::string colmap_images_text(const std::vector<ColmapImage>& images);

}  // namespace lf
