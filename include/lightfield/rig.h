// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <lightfield/error.h>

namespace lightfield {

// World and camera axes are right-handed as in OpenCV and COLMAP: x right, y down, z forward. Lengths are in metres.
struct Vec3 {
  double x = 0, y = 0, z = 0;
};

// A rotation as a unit quaternion (norm within 1e-6 of 1).
struct Quaternion {
  double w = 1, x = 0, y = 0, z = 0;
};

// Transforms camera coordinates to world coordinates. The default camera is at the origin and looks along z.
struct Pose {
  Vec3 position = {};           // centre of projection in the world
  Quaternion orientation = {};  // rotates camera axes to world axes
};

// Returns the pose at `eye` that looks at `target`, upright: its y axis is as close as possible to the world's y axis,
// which points down. Throws Error if both points are equal or the line of sight is vertical.
Pose look_at(const Vec3& eye, const Vec3& target);

// Maps camera coordinates to pixels. (0, 0) is the centre of the top-left pixel. With u = X / Z, v = Y / Z and r^2 =
// u^2 + v^2 (Brown's model as in OpenCV's calib3d and COLMAP's OPENCV):
//   u' = u (1 + k1 r^2 + k2 r^4) + 2 p1 u v + p2 (r^2 + 2 u^2),  v' = v (1 + ...) + p1 (r^2 + 2 v^2) + 2 p2 u v
// and the pixel is (fx u' + cx, fy v' + cy).
struct Lens {
  double fx = 1, fy = 1, cx = 0, cy = 0;  // pixels; focal lengths above 0
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0;
};

// Colour calibration of a camera: maps its colours to the common colours of the array. With v a colour of the camera, 0
// to 255 in each channel, and r the distance to the principal point in half image diagonals:
//   light = ((v - black) / 255) ^ gamma,  level = 255 (matrix light / (1 + k1 r^2 + k2 r^4)) ^ (1 / 2.2)
// Below level 30 the powers are replaced by straight lines. See docs/architecture.md, "Colours".
struct CameraColour {
  Vec3 black = {};  // levels of R, G and B without light: -64 to 64
  double gamma = 2.2;
  std::array<double, 9> matrix = {1, 0, 0, 0, 1, 0, 0, 0, 1};  // row by row
  std::array<double, 2> vignetting = {0, 0};                   // k1, k2
};

struct Camera {
  uint32_t id = 0;  // shown to users; unique in the rig
  std::string name = {};
  int width = 0, height = 0;  // pixels, 1 to 16384
  Lens lens = {};
  Pose world_from_camera = {};
  std::string image = {},
              source = {};  // still image and stream, relative to the rig file; not used by this library; may be empty
  std::optional<CameraColour> colour = {};  // without a value, colours are used unchanged
};

// Triangles with cameras as corners. A line of sight takes its colour from the corners of the triangle that it crosses.
// See docs/architecture.md, "The rendering rule".
struct Topology {
  enum class Type {
    kDelaunay,  // Delaunay triangulation of the camera positions in their best-fit plane
    kGrid,      // cells of rows x columns cameras in row order, each split into two triangles
    kTriangles,
  };
  Type type = Type::kDelaunay;
  int rows = 0, columns = 0;                            // kGrid: rows x columns is the number of cameras
  std::vector<std::array<uint32_t, 3>> triangles = {};  // kTriangles: camera indices
};

// An immutable camera array. Copies share their data and may be used from any thread. The rest of this library
// identifies cameras by index, 0 to size() - 1.
class Rig {
 public:
  // Throws Error if there are no cameras or a camera is invalid; the text names the camera and the problem.
  explicit Rig(const std::vector<Camera>& cameras, const Topology& topology = {});

  size_t size() const;
  // Throws Error if the index is out of range.
  Camera camera(size_t index) const;
  // Hash of everything that pictures depend on: sizes, lenses, poses and triangles. Requests and answers carry the
  // hash.
  uint64_t hash() const;

  // Returns the rig as the text of a rig file (docs/reference/files.md), without loss of precision. Keeps keys of the
  // original file that this version does not know.
  std::string json() const;

  struct Data;  // internal
  explicit Rig(std::shared_ptr<const Data> data) : data_(std::move(data)) {}
  const Data& data() const { return *data_; }

 private:
  std::shared_ptr<const Data> data_;
};

// Read and write rig files. Throw Error with the file and the place.
Rig load_rig(const std::string& path);
void save_rig(const Rig& rig, const std::string& path);
// Parses the text of a rig file. `name` is the file name in error texts.
Rig parse_rig(const std::string& json, const std::string& name = "rig");

struct View {
  int width = 640, height = 480;  // pixels, 1 to 16384
  Pose world_from_view = {};
  double fov_y = 45;              // vertical field of view, degrees, above 0 and below 180
  std::optional<Lens> lens = {};  // any lens, distorted or off centre; replaces fov_y
  double focus_distance = 2;      // metres along the optical axis to the plane in focus, which faces the view
  // diameter of the simulated lens, metres; blurs everything off the focal plane; 0: as sharp as possible
  double aperture = 0;
};

// Returns a view to start with. It is in the middle of the cameras, in their direction, with the vertical field of view
// of the middle camera. The focus distance is four times the diameter of the array, or 1 m if the diameter is 0. Throws
// Error for invalid sizes.
View home_view(const Rig& rig, int width, int height);

enum class Focus : uint8_t {
  kPlane,  // the plane at focus_distance
  kAuto,   // each pixel on a surface found by comparing the cameras, which improves with every picture;
           // kPlane until the surface is clearly better. See docs/quality.md
};

// Full-range RGB.
struct Colour {
  uint8_t r = 0, g = 0, b = 0;
};

}  // namespace lightfield
