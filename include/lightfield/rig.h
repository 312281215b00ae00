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

// World and camera axes are right-handed, as in OpenCV and COLMAP: x points right, y down and z forward. Lengths are in
// metres.
struct Vec3 {
  double x = 0, y = 0, z = 0;
};

// A rotation as a unit quaternion. The norm may differ from 1 by up to 1e-6, so that values from a text file are
// accepted.
struct Quaternion {
  double w = 1, x = 0, y = 0, z = 0;
};

// Transforms camera coordinates to world coordinates. The default camera is at the origin and looks along z.
struct Pose {
  Vec3 position = {};           // centre of projection in the world
  Quaternion orientation = {};  // rotates camera axes to world axes
};

// Returns the pose at `eye` that looks at `target` without roll: its y axis is as close as possible to the world's y
// axis, which points down. Throws Error if both points are equal or the line of sight is vertical.
Pose look_at(const Vec3& eye, const Vec3& target);

// Maps camera coordinates (X, Y, Z) to pixels, like OpenCV and COLMAP. The centre of the top-left pixel is (0, 0). With
// u = X / Z, v = Y / Z and r^2 = u^2 + v^2:
//   u' = u g + 2 p1 u v + p2 (r^2 + 2 u^2),  v' = v g + p1 (r^2 + 2 v^2) + 2 p2 u v,
//   g = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
// and the pixel is (fx u' + cx, fy v' + cy). This is COLMAP's model FULL_OPENCV, and OPENCV if k3 to k6 are 0.
//
// If `fisheye`, (u, v) is first multiplied by atan(r) / r, and r is then the length of the product. The other terms are
//   g = 1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8
// and s1 r^2 is added to u', s2 r^2 to v'. This is COLMAP's model THIN_PRISM_FISHEYE, and OPENCV_FISHEYE if p1, p2, s1
// and s2 are 0. A camera sees points up to 95 degrees from its axis, where the product is (X, Y) times the angle
// divided by sqrt(X^2 + Y^2). A view ends a little before 90 degrees.
struct Lens {
  double fx = 1, fy = 1, cx = 0, cy = 0;  // pixels; fx and fy must be positive
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0;
  double k3 = 0, k4 = 0;
  double k5 = 0, k6 = 0;  // 0 if fisheye
  double s1 = 0, s2 = 0;  // 0 unless fisheye
  bool fisheye = false;
};

// The colour calibration of a camera, which maps its colours to the common colours of the array. If v is a colour of
// the camera (0 to 255 in each channel) and r is the distance to the principal point, in units of half the image
// diagonal:
//   light = ((v - black) / 255) ^ gamma,  level = 255 (matrix light / (1 + k1 r^2 + k2 r^4)) ^ (1 / 2.2)
// Straight lines replace the powers below level 30. See docs/architecture.md, "Colours".
struct CameraColour {
  Vec3 black = {};  // levels of R, G and B that the camera delivers in darkness: -64 to 64
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

// Divides the array into triangles with cameras as corners. Each pixel of a view takes its colour from the three
// corners of the triangle that its line of sight crosses. See docs/architecture.md, "The rendering rule".
struct Topology {
  enum class Type {
    kDelaunay,  // Delaunay triangulation of the camera positions in their best-fit plane
    kGrid,      // cells of a grid of rows x columns cameras in row order; each cell is split into two triangles
    kTriangles,
  };
  Type type = Type::kDelaunay;
  int rows = 0, columns = 0;                            // kGrid only; rows x columns must be the number of cameras
  std::vector<std::array<uint32_t, 3>> triangles = {};  // kTriangles only; camera indices
};

// An immutable description of a camera array. Copies share their data and may be used from any thread. The rest of this
// library identifies a camera by its index, 0 to size() - 1.
class Rig {
 public:
  // Creates a rig from a list of cameras, and from the triangles between these cameras. Throws Error if there are no
  // cameras or a camera is invalid. The text of the error names the camera and the problem.
  explicit Rig(const std::vector<Camera>& cameras, const Topology& topology = {});

  size_t size() const;
  // Returns a copy of the camera with this index. Throws Error if the index is not 0 to size() - 1.
  Camera camera(size_t index) const;
  // Returns a hash of everything that pictures depend on: sizes, lenses, poses and triangles. Requests and answers
  // carry this hash, so that a node rejects requests for another rig.
  uint64_t hash() const;

  // Returns the text of a rig file (docs/reference/files.md), without loss of precision. If the rig was loaded, keys
  // that this version does not know are preserved.
  std::string json() const;

  struct Data;  // internal
  explicit Rig(std::shared_ptr<const Data> data) : data_(std::move(data)) {}
  const Data& data() const { return *data_; }

 private:
  std::shared_ptr<const Data> data_;
};

// Read and write rig files, which are JSON (docs/reference/files.md). These functions throw Error with the file name
// and the place in the file.
Rig load_rig(const std::string& path);
void save_rig(const Rig& rig, const std::string& path);
// Parses the text of a rig file that the caller has read. `name` is the name that error messages give to the file.
Rig parse_rig(const std::string& json, const std::string& name = "rig");

struct View {
  int width = 640, height = 480;  // pixels, 1 to 16384
  Pose world_from_view = {};
  double fov_y = 45;              // vertical field of view, degrees, more than 0 and less than 180
  std::optional<Lens> lens = {};  // replaces fov_y by any lens, which may have distortion or be off centre
  // metres along the optical axis to the plane in focus, which is perpendicular to the axis
  double focus_distance = 2;
  // Diameter of the simulated lens, in metres. If the focus is Focus::kPlane, everything off the focal plane is
  // blurred, as by a real lens of this size. Otherwise all depths stay sharp. 0: three cameras per pixel.
  double aperture = 0;
  uint64_t reserved[4] = {};  // space for the options of later versions; must be 0
};

// Returns a view to start with, which the user can then move. The view is in the middle of the cameras, looks in their
// mean direction, and has the vertical field of view of the middle camera. The focus distance is four times the
// diameter of the array, or 1 m if the diameter is 0. Throws Error for invalid sizes.
View home_view(const Rig& rig, int width, int height);

enum class Focus : uint8_t {
  kPlane,  // everything is rendered as if it lay on the plane at focus_distance
  // Each pixel lies on a surface that is estimated by comparing the cameras, and that improves with every picture. The
  // plane is used until the surface is clearly better. See docs/quality.md.
  kAuto,
};

// An RGB colour, full range.
struct Colour {
  uint8_t r = 0, g = 0, b = 0;
};

}  // namespace lightfield
