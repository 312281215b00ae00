// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "geometry/lens.h"
#include "geometry/pose.h"
#include "image/colour_correction.h"

namespace lf {

// A camera is named by its index in the rig everywhere inside the system and on the wire; `id` is for people.
using CameraIndex = uint32_t;
// Ascending, no repeats.
using CameraSet = std::vector<CameraIndex>;

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
  std::string label() const;  // for messages: "camera 3 (left)", "camera 3" without a name
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

// A run of cameras with neighbouring indices, both ends included.
struct CameraRange {
  CameraIndex first = 0, last = 0;
  auto operator<=>(const CameraRange&) const = default;
};

// A set of cameras as ascending runs that neither touch nor overlap: how nodes, which have rows or blocks of an array,
// name their cameras briefly.
class CameraRanges {
 public:
  CameraRanges() = default;
  // Ascending, no repeats.
  explicit CameraRanges(std::span<const CameraIndex> cameras);

  // Appends a run; false, and nothing is changed, if it does not lie beyond the others with a gap or is upside down.
  bool append(const CameraRange& range);
  void add(const CameraRanges& other);
  void remove(const CameraRanges& other);

  bool contains(CameraIndex camera) const;
  bool contains(const CameraRanges& other) const;
  bool intersects(const CameraRanges& other) const;
  bool empty() const { return ranges_.empty(); }
  size_t size() const;  // number of cameras
  CameraSet cameras() const;
  const std::vector<CameraRange>& ranges() const { return ranges_; }
  auto operator<=>(const CameraRanges&) const = default;  // any order, for maps

 private:
  std::vector<CameraRange> ranges_;
};

// The smallest and the largest coordinates of the cameras, metres. For a rig with at least one camera.
std::pair<Vec3, Vec3> bounding_box(const Rig& rig);
// The axis (0 to 2) along which the cameras extend farthest.
int widest_axis(const Rig& rig);

// Distances between cameras, in metres; 0 for fewer than two. Faster than all pairs: rigs may have 65,535 cameras.

// The largest distance between two cameras, to 1e-9 of it.
double largest_distance(const Rig& rig);
// The mean over all cameras of the distance to the nearest other one.
double mean_nearest_distance(const Rig& rig);

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

// The same for cameras mounted in other shapes. A row of cameras is a grid of one row.

// Cameras on an arc of a circle, at one height, that all look at its centre; camera 0 is the left one. The world is
// that of the arc's middle: the centre lies at (0, 0, radius). Views blend along the arc, as along a row.
struct ArcRigOptions {
  int cameras = 0;
  double pitch = 0;   // metres between neighbours, along the straight line
  double radius = 0;  // metres; the arc must be less than half a circle
  double fov_y_deg = 0;
  int width = 640, height = 480;  // pixels
};
// Throws Error ("pitch: must be positive").
Rig make_arc_rig(const ArcRigOptions& options);

// Cameras on a circle in the plane z = 0 that all look along +z, as a ring light does. Camera 0 is at the top, the
// others follow clockwise as the cameras see it. Their mesh is the circle's Delaunay triangulation.
struct RingRigOptions {
  int cameras = 0;    // three at least
  double radius = 0;  // metres
  double fov_y_deg = 0;
  int width = 640, height = 480;  // pixels
};
// Throws Error ("radius: must be positive").
Rig make_ring_rig(const RingRigOptions& options);

// Rows of cameras around an upright cylinder, evenly, that look at its axis or away from it. Row 0 is the top one, and
// in each row cameras follow to the right as they see it. The world is that of camera 0's column: it looks along +z,
// from (0, y, 0) at the axis, which is at (0, radius) in x and z, or from (0, y, radius) away from the one at (0, 0);
// the rows' middle is at y = 0. The mesh closes around the cylinder, so that every line of sight that passes between
// two rows has its triangle.
struct CylinderRigOptions {
  int rows = 0, columns = 0;  // two and three at least
  double pitch = 0;           // metres between rows
  double radius = 0;          // metres
  bool inward = true;
  double fov_y_deg = 0;
  int width = 640, height = 480;  // pixels
};
// Throws Error ("radius: must be positive").
Rig make_cylinder_rig(const CylinderRigOptions& options);

}  // namespace lf
