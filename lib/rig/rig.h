// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "geometry/lens.h"
#include "geometry/pose.h"
#include "image/colour_model.h"

namespace lf {

// A camera is named by its index in the rig everywhere inside the system and on the wire; `id` is for people.
using CameraIndex = uint32_t;

inline constexpr CameraIndex kMaxCameras = 65535;
inline constexpr int kMaxImageSize = 16384;  // pixels a side, of a camera image or a view

struct Camera {
  uint32_t id = 0;  // unique in the rig
  std::string name;
  int width = 0, height = 0;  // pixels
  Lens lens;
  Pose pose;               // world_from_camera
  std::string image;       // a still, relative to the rig file; may be empty
  std::string source;      // any GStreamer URI or path relative to the rig file; may be empty
  double time_offset = 0;  // seconds; true capture time = stamp + offset
  // The camera's colours as they were measured; nothing: they are taken as they come.
  std::optional<ColourModel> colour;

  Vec2 principal_point() const { return {lens.cx(), lens.cy()}; }
};

struct Topology {
  enum class Type { kGrid, kTriangles, kDelaunay };
  Type type = Type::kDelaunay;
  int rows = 0, columns = 0;                          // kGrid, row-major: rows * columns == number of cameras
  std::vector<std::array<CameraIndex, 3>> triangles;  // kTriangles
};

// One array of cameras. A plain value: copy it, share it const between threads.
struct Rig {
  std::vector<Camera> cameras;
  Topology topology;
  std::string directory;  // where the rig file is, "" without one; relative paths start here

  // 64-bit FNV-1a over what a view's weights depend on: sizes, lenses, poses, topology. Never 0. Colours are no part of
  // it: nodes correct their own cameras', and what they answer fits together.
  uint64_t hash() const;
  std::optional<CameraIndex> index_of_id(uint32_t id) const;
  // Whether the colours of any camera were measured.
  bool has_colour() const;
  // `path` as found in `image` or `source`: absolute paths and URIs stay as they are.
  std::string resolve(const std::string& path) const;
};

// Whether `path` begins with a scheme of two characters or more and "://" (or is a file:/, data: or testbin: URI).
bool is_uri(const std::string& path);

// Rewrites relative paths of images and sources so that they mean the same from `directory` ("": the current one),
// which becomes Rig::directory. Throws Error where a folder cannot be that of a file (its name is too long).
void relocate(Rig& rig, const std::string& directory);

// A rig of the cameras named by their index, in that order and with their ids and names; a grid stays a grid where
// `indices` are full rows x columns of it (`rows`, `columns` of the result given), else the topology becomes Delaunay.
Rig sub_rig(const Rig& rig, const std::vector<CameraIndex>& indices);
// Rows and columns 0, n, 2n, ... of a grid. Throws Error if the topology is not a grid or n < 1.
Rig every_nth(const Rig& rig, int n);
// "0-3,7" to indices {0, 1, 2, 3, 7} of the cameras with these ids; ascending, without repeats. "" is all.
// Throws Error naming the part that is not a camera of the rig.
std::vector<CameraIndex> parse_camera_list(const Rig& rig, const std::string& list);

// A first rig for somebody who has just mounted cameras on a flat board: rows x columns of them, `pitch` metres apart,
// around the origin of the plane z = 0, looking along +z; row 0 is the top one, ids and names ("cam_00_00") row by row.
// All with the same lens: `fov_y_deg` is the vertical field of view, RADIAL without distortion, ready to be calibrated.
struct GridRigOptions {
  int rows = 0, columns = 0;
  double pitch = 0;
  double fov_y_deg = 0;
  int width = 640, height = 480;  // pixels
};

// Throws Error ("pitch: must be positive").
Rig make_grid_rig(const GridRigOptions& options);

}  // namespace lf
