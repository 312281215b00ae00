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

// The system and the wire formats identify a camera by its index in the rig; `id` is for people.
using CameraIndex = uint32_t;
// Ascending, without duplicates.
using CameraSet = std::vector<CameraIndex>;

inline constexpr CameraIndex kMaxCameras = 65535;
inline constexpr int kMaxImageSize = 16384;  // pixels per side, for camera images and views

struct Camera {
  uint32_t id = 0;  // unique in the rig
  std::string name;
  int width = 0, height = 0;  // pixels
  Lens lens;
  Pose pose;               // world_from_camera
  std::string image;       // still image, relative to the rig file; may be empty
  std::string source;      // any GStreamer URI or path relative to the rig file; may be empty
  double time_offset = 0;  // seconds; capture time = timestamp + offset
  // The measured colour response; nullopt: no correction.
  std::optional<ColourModel> colour;

  Vec2 principal_point() const { return {lens.cx(), lens.cy()}; }
  std::string label() const;  // for messages: "camera 3 (left)", or "camera 3" without a name
};

struct Topology {
  enum class Type { kGrid, kTriangles, kDelaunay };
  Type type = Type::kDelaunay;
  int rows = 0, columns = 0;                          // kGrid, row-major; rows * columns == number of cameras
  std::vector<std::array<CameraIndex, 3>> triangles;  // kTriangles
};

// A camera array. A value type: copy it, or share it const between threads.
struct Rig {
  std::vector<Camera> cameras;
  Topology topology;
  std::string directory;  // folder of the rig file, "" if there is no file; base of relative paths

  // Returns a 64-bit FNV-1a hash of everything that the blending weights depend on: sizes, lenses, poses, topology.
  // Never 0. Colours are excluded: each node corrects its own cameras, so answers stay compatible.
  uint64_t hash() const;
  std::optional<CameraIndex> index_of_id(uint32_t id) const;
  bool has_colour() const;
  // Resolves `path`, the value of an `image` or `source`. Absolute paths and URIs are returned unchanged.
  std::string resolve(const std::string& path) const;
};

// True if `path` begins with a scheme of at least two characters and "://", or is a file:/, data: or testbin: URI.
bool is_uri(const std::string& path);

// Rewrites relative image and source paths to be relative to `directory` ("": the current folder), the new
// Rig::directory. Throws Error if a folder cannot be resolved (its name is too long).
void rebase_paths(Rig& rig, const std::string& directory);

// Returns a rig with the given cameras in the given order; ids and names are kept. If `indices` are full rows x columns
// of a grid, the result is a grid. Otherwise the topology becomes Delaunay.
Rig rig_subset(const Rig& rig, const std::vector<CameraIndex>& indices);
// Keeps rows and columns 0, n, 2n, ... of a grid. Throws Error if the topology is not a grid or n < 1.
Rig subsample_grid(const Rig& rig, int n);
// Parses a list of camera ids like "0-3,7" and returns the cameras' indices, ascending and without duplicates. "" means
// all cameras. Throws Error with the part that names no camera of the rig.
std::vector<CameraIndex> parse_camera_list(const Rig& rig, const std::string& list);

struct CameraRange {
  CameraIndex first = 0, last = 0;
  auto operator<=>(const CameraRange&) const = default;
};

// A set of cameras as ascending ranges that neither touch nor overlap. Compact for nodes that have rows or blocks of an
// array.
class CameraRanges {
 public:
  CameraRanges() = default;
  // `cameras` must be ascending, without duplicates.
  explicit CameraRanges(std::span<const CameraIndex> cameras);

  // Appends a range. Returns false and changes nothing if the range is reversed or does not start at least two indices
  // after the last range.
  bool append(const CameraRange& range);
  void add(const CameraRanges& other);
  void remove(const CameraRanges& other);

  bool contains(CameraIndex camera) const;
  bool contains(const CameraRanges& other) const;
  bool intersects(const CameraRanges& other) const;
  bool empty() const { return ranges_.empty(); }
  size_t size() const;
  CameraSet cameras() const;
  const std::vector<CameraRange>& ranges() const { return ranges_; }
  auto operator<=>(const CameraRanges&) const = default;  // arbitrary but fixed order, for maps

 private:
  std::vector<CameraRange> ranges_;
};

// The minimum and maximum coordinates of the camera positions, in metres. The rig must have at least one camera.
std::pair<Vec3, Vec3> bounding_box(const Rig& rig);
// The axis (0 to 2) of the largest extent of the camera positions.
int widest_axis(const Rig& rig);

// Distances between cameras, in metres; 0 for fewer than two cameras. Faster than comparing all pairs, because rigs can
// have 65,535 cameras.

// The largest distance between two cameras, with a relative error of at most 1e-9.
double largest_distance(const Rig& rig);
// The mean over all cameras of the distance to the nearest other camera.
double mean_nearest_distance(const Rig& rig);

// A starting rig for cameras on a flat board: rows x columns, `pitch` metres apart, centred on the origin in the plane
// z = 0, looking along +z. Row 0 is the top row; ids and names ("cam_00_00") are row by row. All cameras share one
// RADIAL lens without distortion, ready for calibration; `fov_y_deg` is the vertical field of view.
struct GridRigOptions {
  int rows = 0, columns = 0;
  double pitch = 0;
  double fov_y_deg = 0;
  int width = 640, height = 480;  // pixels
};

// Throws Error ("pitch: must be positive").
Rig make_grid_rig(const GridRigOptions& options);

// Starting rigs for other shapes. A row of cameras is a grid with one row.

// Cameras at the same height on an arc of a circle, looking at its centre; camera 0 is the leftmost. The origin is the
// middle of the arc, and the centre lies at (0, 0, radius). Views blend along the arc as along a row.
struct ArcRigOptions {
  int cameras = 0;
  double pitch = 0;   // metres between neighbours, measured along the chord
  double radius = 0;  // metres; the arc must be less than half a circle
  double fov_y_deg = 0;
  int width = 640, height = 480;  // pixels
};
// Throws Error ("pitch: must be positive").
Rig make_arc_rig(const ArcRigOptions& options);

// Cameras on a circle in the plane z = 0, all looking along +z, like a ring light. Camera 0 is at the top; the rest
// follow clockwise as seen by the cameras. Their mesh is the Delaunay triangulation of the circle.
struct RingRigOptions {
  int cameras = 0;    // at least three
  double radius = 0;  // metres
  double fov_y_deg = 0;
  int width = 640, height = 480;  // pixels
};
// Throws Error ("radius: must be positive").
Rig make_ring_rig(const RingRigOptions& options);

// Evenly spaced rows of cameras around an upright cylinder, looking at its axis or away from the axis. Row 0 is the top
// row; within a row, cameras follow to the right as seen by the cameras. Camera 0's column looks along +z and defines
// the world: inward, it is at (0, y, 0) and the axis at x = 0, z = radius; outward, it is at (0, y, radius) and the
// axis at x = 0, z = 0. The middle of the rows is at y = 0. The mesh closes around the cylinder, so every line of sight
// between two rows passes through a triangle.
struct CylinderRigOptions {
  int rows = 0, columns = 0;  // at least two rows and three columns
  double pitch = 0;           // metres between rows
  double radius = 0;          // metres
  bool inward = true;
  double fov_y_deg = 0;
  int width = 640, height = 480;  // pixels
};
// Throws Error ("radius: must be positive").
Rig make_cylinder_rig(const CylinderRigOptions& options);

}  // namespace lf
