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

// Axes are right-handed, of the world and of cameras alike: x right, y down, z forward, as OpenCV and COLMAP have them.
// Lengths are metres.
struct Vec3 {
  double x = 0, y = 0, z = 0;
};

// A rotation as a quaternion of unit norm (to 1e-6).
struct Quaternion {
  double w = 1, x = 0, y = 0, z = 0;
};

// The pose of a camera, which takes points of the camera to the world. The default camera stands in the world's origin
// and looks along z.
struct Pose {
  Vec3 position = {};           // the centre of projection in the world
  Quaternion orientation = {};  // turns the camera's axes to where they point in the world
};

// The pose at `eye` that looks at `target`, its y axis as near to the world's y, which is down, as it can be. Throws
// Error where the two are one place or the line of sight is vertical.
Pose look_at(const Vec3& eye, const Vec3& target);

// A lens maps camera coordinates to pixels. (0, 0) is the centre of the top-left pixel. With u = X / Z, v = Y / Z and
// r^2 = u^2 + v^2 (Brown's model as in OpenCV's calib3d and COLMAP's OPENCV):
//   u' = u (1 + k1 r^2 + k2 r^4) + 2 p1 u v + p2 (r^2 + 2 u^2),  v' = v (1 + ...) + p1 (r^2 + 2 v^2) + 2 p2 u v
// and the pixel is (fx u' + cx, fy v' + cy).
struct Lens {
  double fx = 1, fy = 1, cx = 0, cy = 0;  // pixels; focal lengths above 0
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0;  // distortion
};

// How a camera's colours differ from those that all of an array are to have, for pictures to be made without the
// difference. With v a colour of the camera, 0 to 255 in each channel, and r = 1 half a diagonal of the image away from
// the lens's principal point:
//   light = ((v - black) / 255) ^ gamma,  level = 255 (matrix light / (1 + k1 r^2 + k2 r^4)) ^ (1 / 2.2)
// but for levels below 30, where powers are straight lines. See docs/design.md, "Colours".
struct CameraColour {
  Vec3 black = {};  // levels of R, G and B that a camera gives for no light: -64 to 64
  double gamma = 2.2;
  std::array<double, 9> matrix = {1, 0, 0, 0, 1, 0, 0, 0, 1};  // entries row by row
  std::array<double, 2> vignetting = {0, 0};                   // k1, k2
};

// One camera of an array.
struct Camera {
  uint32_t id = 0;  // a number for people; unique in the rig
  std::string name = {};
  int width = 0, height = 0;  // size of the camera's images, pixels, 1 to 16384
  Lens lens = {};
  Pose world_from_camera = {};
  std::string image = {},
              source = {};  // a still and a stream, relative to the rig's file, for those who open them; may be empty
  std::optional<CameraColour> colour = {};  // as it was measured; without a value colours are taken as they come
};

// The triangles whose corners are cameras: a line of sight takes its colour from the corners of the triangle that it
// passes. See docs/design.md, "The rendering rule".
struct Topology {
  enum class Type {
    kDelaunay,   // the Delaunay triangulation of the cameras' places in the plane that fits them best
    kGrid,       // cells of rows x columns cameras, row by row, each cut into two triangles
    kTriangles,  // the triangles that are listed
  };
  Type type = Type::kDelaunay;
  int rows = 0, columns = 0;                            // for kGrid: rows x columns is the number of cameras
  std::vector<std::array<uint32_t, 3>> triangles = {};  // for kTriangles: indices of cameras
};

// An array of cameras that never changes: copies share it, from any thread. Everywhere else in this library a camera is
// named by its index, 0 to size() - 1.
class Rig {
 public:
  // Throws Error naming the camera and what is wrong with it, and for an array without cameras.
  explicit Rig(const std::vector<Camera>& cameras, const Topology& topology = {});

  size_t size() const;
  // Throws Error for an index that is not one.
  Camera camera(size_t index) const;
  // A number made of all that pictures depend on: sizes, lenses, poses and triangles. Requests and answers carry it.
  uint64_t hash() const;

  // The rig as the text of a rig file, to the last bit. What this version does not know of the text that it was read
  // from is kept (docs/guide-cameras.md has the format).
  std::string json() const;

  struct Data;  // internal
  explicit Rig(std::shared_ptr<const Data> data) : data_(std::move(data)) {}
  const Data& data() const { return *data_; }

 private:
  std::shared_ptr<const Data> data_;
};

// Read and write rig files. Throw Error naming the file and the place in it.
Rig load_rig(const std::string& path);
void save_rig(const Rig& rig, const std::string& path);
// A rig from the text of a rig file. Throws Error in which `name` stands for the file.
Rig parse_rig(const std::string& json, const std::string& name = "rig");

// A virtual camera: what is to be seen.
struct View {
  int width = 640, height = 480;  // pixels, 1 to 16384
  Pose world_from_view = {};
  double fov_y = 45;              // degrees from the top to the bottom, above 0 and below 180
  std::optional<Lens> lens = {};  // any lens, distorted or off centre, in place of fov_y
  double focus_distance = 2;      // metres along the optical axis to the plane that is sharp: it faces the view
  double aperture = 0;            // metres: a lens so wide, which blurs what is off that plane; 0: as sharp as can be
};

// A view to begin with: it stands amid the cameras, looking where they look, with the vertical field of view of the
// middle one, focused at four times the diameter of the array (at 1 m where it has none). Throws Error for sizes that
// no view has.
View home_view(const Rig& rig, int width, int height);

// How a view is focused.
enum class Focus : uint8_t {
  kPlane,  // on the plane at focus_distance
  kAuto,  // every pixel on its own, on a surface that is found from where the cameras agree, better with every picture;
          // on the plane until that is clearly better. See docs/focus.md
};

// A colour, full range.
struct Colour {
  uint8_t r = 0, g = 0, b = 0;
};

}  // namespace lightfield
