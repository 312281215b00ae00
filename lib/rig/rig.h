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

// The index of a camera in the rig. It identifies the camera in this system and on the wire, whereas Camera::id is for
// people.
using CameraIndex = uint32_t;
// Camera indices, ascending and without duplicates.
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
  std::string source;      // a GStreamer URI, or a path relative to the rig file; may be empty
  double time_offset = 0;  // seconds to add to the timestamps of frames to get their capture time
  // The measured colours of the camera; nullopt: frames are not corrected.
  std::optional<ColourModel> colour;

  Vec2 principal_point() const { return {lens.cx(), lens.cy()}; }
  std::string label() const;  // Name of the camera in messages: "camera 3 (left)", or "camera 3" without a name.
};

struct Topology {
  enum class Type { kGrid, kTriangles, kDelaunay };
  Type type = Type::kDelaunay;
  // kGrid only, in row order; rows * columns is the number of cameras
  int rows = 0, columns = 0;
  std::vector<std::array<CameraIndex, 3>> triangles;
};

// A camera array, as described by a rig file. A value type: copy it, or share it const between threads.
struct Rig {
  std::vector<Camera> cameras;
  Topology topology;
  std::string directory;  // folder of the rig file, the base of relative paths; "" without a file
  // Distance of the scene from default_viewpoint() along its axis, in metres; 0 if it is unknown. Viewers focus there
  // first.
  double focus_distance = 0;

  // Returns a 64-bit hash (FNV-1a) of everything that the blending weights depend on: sizes, lenses, poses and
  // topology. All nodes of a view compare this hash, to be sure that they use the same rig. The hash is never 0.
  // Colours are excluded, because each node corrects its own cameras, so that nodes with other colours still work
  // together.
  uint64_t hash() const;
  std::optional<CameraIndex> index_of_id(uint32_t id) const;
  bool has_colour() const;
  // Returns where an `image` or `source` of the rig file is. `path` is relative to the folder of the rig file; absolute
  // paths and URIs stay unchanged.
  std::string resolve(const std::string& path) const;
};

// Returns true if `path` is a URI instead of a file name. It then begins with a scheme of at least two characters and
// "://", or with file:/, data: or testbin:.
bool is_uri(const std::string& path);

// Makes relative image and source paths start from `directory` ("": the current folder), which becomes the new
// Rig::directory. This is needed before a rig is saved in another folder. Throws Error if a folder cannot be resolved,
// for example because its name is too long.
void rebase_paths(Rig& rig, const std::string& directory);

// Returns a rig of the selected cameras in the given order; ids and names are kept. The result is a grid if `indices`
// are complete rows and columns of a grid. Otherwise the topology is Delaunay, because the triangles of the whole rig
// need all cameras.
Rig rig_subset(const Rig& rig, const std::vector<CameraIndex>& indices);
// Returns a rig of every n-th row and column of a grid: 0, n, 2n, and so on. Throws Error if the topology is not a grid
// or n is less than 1.
Rig subsample_grid(const Rig& rig, int n);
// Parses a list of camera ids, for example "0-3,7", which selects the cameras 0, 1, 2, 3 and 7. Returns the indices of
// these cameras, ascending and without duplicates; "" selects all cameras. Throws Error with the part of the list that
// names no camera of the rig.
std::vector<CameraIndex> parse_camera_list(const Rig& rig, const std::string& list);

struct CameraRange {
  CameraIndex first = 0, last = 0;
  auto operator<=>(const CameraRange&) const = default;
};

// A set of cameras, stored as ascending ranges that neither touch nor overlap. This is compact, because nodes usually
// have rows or blocks of an array.
class CameraRanges {
 public:
  CameraRanges() = default;
  // Creates a set from camera indices, which must be ascending and without duplicates.
  explicit CameraRanges(std::span<const CameraIndex> cameras);

  // Appends a range. Returns false and changes nothing if the range is reversed, or does not start at least two indices
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
  auto operator<=>(const CameraRanges&) const = default;  // an arbitrary but fixed order, for maps

 private:
  std::vector<CameraRange> ranges_;
};

// Returns the corners of the smallest box around the camera positions, along the world axes, in metres. The rig must
// have at least one camera.
std::pair<Vec3, Vec3> bounding_box(const Rig& rig);
// Returns the axis (0 to 2) along which the camera positions spread most.
int widest_axis(const Rig& rig);

// Distances between cameras in metres; the result is 0 for fewer than two cameras.

// Returns the distance between the two cameras that are farthest apart, with a relative error of at most 1e-9.
double largest_distance(const Rig& rig);
// Returns the mean over all cameras of the distance to the nearest other camera.
double mean_nearest_distance(const Rig& rig);

// Describes a nominal rig of cameras on a flat board, as a start for calibration: rows x columns, `pitch` metres apart.
// The board is in the plane z = 0, centred on the origin, and the cameras look along +z. Row 0 is the top row; ids and
// names ("cam_00_00") go row by row. All cameras have the same RADIAL lens without distortion; `fov_y_deg` is their
// vertical field of view.
struct GridRigOptions {
  int rows = 0, columns = 0;
  double pitch = 0;
  double fov_y_deg = 0;
  int width = 640, height = 480;  // pixels
};

// Creates a nominal rig. Throws Error if an option is out of range, for example "pitch: must be positive".
Rig make_grid_rig(const GridRigOptions& options);

// Cameras at the same height on an arc of a circle, looking at the centre of the circle. Camera 0 is the leftmost. The
// origin is the middle of the arc, and the centre is at (0, 0, radius). Views blend along the arc as along a row.
struct ArcRigOptions {
  int cameras = 0;
  double pitch = 0;   // metres between neighbours, in a straight line
  double radius = 0;  // metres; the arc must be less than half a circle
  double fov_y_deg = 0;
  int width = 640, height = 480;  // pixels
};
Rig make_arc_rig(const ArcRigOptions& options);

// Cameras on a circle in the plane z = 0, all looking along +z, like a ring light. Camera 0 is at the top; the next
// cameras follow clockwise, as seen by the cameras. The mesh is the Delaunay triangulation of the circle.
struct RingRigOptions {
  int cameras = 0;    // at least three
  double radius = 0;  // metres
  double fov_y_deg = 0;
  int width = 640, height = 480;  // pixels
};
Rig make_ring_rig(const RingRigOptions& options);

// Evenly spaced rows of cameras around an upright cylinder, facing inward or outward. Row 0 is the top row.
// The cameras of a row follow to the right, as seen by the cameras. The first column looks along +z and defines the
// world. For inward cameras, the first column is at (0, y, 0) and the axis at x = 0, z = radius. For outward cameras,
// it is at (0, y, radius) and the axis at x = 0, z = 0. The middle of the rows is at y = 0. The mesh closes around the
// cylinder, so every line of sight between two rows passes through a triangle.
struct CylinderRigOptions {
  int rows = 0, columns = 0;  // at least two rows and three columns
  double pitch = 0;           // metres between rows
  double radius = 0;          // metres
  bool inward = true;
  double fov_y_deg = 0;
  int width = 640, height = 480;  // pixels
};
Rig make_cylinder_rig(const CylinderRigOptions& options);

}  // namespace lf
