// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <random>
#include <utility>
#include <vector>

#include "image/image.h"
#include "rig/mesh.h"
#include "rig/rig.h"
#include "view/view.h"

namespace lf::reference {

// Seeded random numbers, identical with every standard library.
class Random {
 public:
  explicit Random(uint64_t seed) : engine_(seed) {}

  double uniform(double low, double high) { return low + (high - low) * (engine_() >> 11) * 0x1p-53; }
  int integer(int low, int high) { return low + static_cast<int>(engine_() % static_cast<uint64_t>(high - low + 1)); }
  bool one_in(int n) { return engine_() % static_cast<uint64_t>(n) == 0; }
  Vec3 point_in_box(double half_side) {
    const double x = uniform(-half_side, half_side), y = uniform(-half_side, half_side);
    return {x, y, uniform(-half_side, half_side)};
  }
  Vec3 direction();  // unit length
  Quat orientation();
  Quat small_rotation(double max_angle);

 private:
  std::mt19937_64 engine_;
};

Camera make_camera(uint32_t id, int width, int height, const Lens& lens, const Pose& pose);

// rows x columns cameras in the plane z = 0 around the origin, looking along +z. Images of 64x48, 60 degrees high.
Rig planar_grid(int rows, int columns, double pitch);
Lens grid_lens();

// Returns one of: a grid with jittered poses, Delaunay over such a grid, a cylinder facing outwards or inwards, a
// sphere facing outwards, random triangles with folds. 3 to about 30 cameras within two metres of the origin.
Rig random_rig(Random& random);
// Returns any lens model with realistic distortion.
Lens random_lens(Random& random, int width, int height);
// Views do not extrapolate. The viewpoint is less than two metres from the origin: in front of the array, in its plane, behind it, or at a
// camera.
View random_view(Random& random, const Rig& rig, int width, int height);
// Empty in most cases, otherwise up to a third of the cameras.
CameraSet random_out_of_service(Random& random, const Rig& rig);

Image white_image(int width, int height);
Image noise_image(Random& random, int width, int height);
// Broad waves: neighbouring pixels differ by less than 12 of 255.
Image smooth_image(Random& random, int width, int height);
// One image per camera, from `make`.
std::vector<Image> images_of(const Rig& rig, Random& random, Image (*make)(Random&, int, int));

// The numerically hard cases, shared by the tests that check the bounds and by `bench-render numerics`, which prints
// the errors.
struct HardCase {
  const char* name;
  std::function<std::pair<Rig, View>(Random&)> make;  // creates the n-th of `trials` from a Random with seed n
  int trials = 8;
  double least_owned = 0.2;  // minimum fraction of pixels with an owner, so that the case is not trivial
};
std::vector<HardCase> hard_cases();
// The same with cameras and view of `times` as many rows and columns, where fast renderers leave the border handling of
// their blocks; two trials.
inline constexpr int kEnlarged = 3;
HardCase enlarged(const HardCase& hard, int times);

// Building blocks: a view of 48x36 pixels; 4x4 cameras, 0.5 m apart, with all corners at multiples of a quarter metre.
View view_at(const Vec3& eye, const Quat& orientation = {1, 0, 0, 0}, double fov_y = 60, double focus = 2);
Rig array();
// The same at a pose without round numbers.
std::pair<Rig, View> moved(Rig rig, View view, const Vec3& by, const Quat& turn);

}  // namespace lf::reference
