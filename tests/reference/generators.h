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

// Numbers from a seed, the same with every standard library.
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

// rows x columns in the plane z = 0 around the origin, looking along +z. Images of 64x48, 60 degrees high.
Rig planar_grid(int rows, int columns, double pitch);
Lens grid_lens();

// One of: a grid with jitter in place and direction, Delaunay over such, a cylinder looking outwards or inwards, a
// sphere looking outwards, a soup of random triangles with folds. 3 to about 30 cameras within two metres of the
// origin.
Rig random_rig(Random& random);
// Any of the lens models, with distortion that a real lens could have.
Lens random_lens(Random& random, int width, int height);
// Anywhere within two metres of the origin: in front of the array, in it, behind it, at a camera.
View random_view(Random& random, const Rig& rig, int width, int height);
// None (mostly), or up to a third of the cameras.
CameraSet random_out_of_service(Random& random, const Rig& rig);

Image white_image(int width, int height);
Image noise_image(Random& random, int width, int height);
// Few, broad waves: neighbouring pixels differ by less than 12 of 255.
Image smooth_image(Random& random, int width, int height);
// One image per camera, from `make` above.
std::vector<Image> images_of(const Rig& rig, Random& random, Image (*make)(Random&, int, int));

// The hard cases of numerical stability: one list for the tests that hold the bounds and for `bench-render numerics`,
// which prints what is left of them.
struct HardCase {
  const char* name;
  std::function<std::pair<Rig, View>(Random&)> make;  // for the n-th of `trials`: from a Random of seed n
  int trials = 8;
  double least_owned = 0.2;  // fraction of pixels that some face owns: the case is about something
};
std::vector<HardCase> hard_cases();
// The same seen by cameras and a view of `times` as many rows and columns, where fast renderers leave the borders of
// their blocks behind; two trials.
inline constexpr int kEnlarged = 3;
HardCase enlarged(const HardCase& hard, int times);

// What most of them are made of: a view of 48x36 pixels; 4x4 cameras, 0.5 m apart, all corners at quarters of a metre.
View view_at(const Vec3& eye, const Quat& orientation = {1, 0, 0, 0}, double fov_y = 60, double focus = 2);
Rig array();
// The same with a pose in the world that is not made of round numbers.
std::pair<Rig, View> moved(Rig rig, View view, const Vec3& by, const Quat& turn);

}  // namespace lf::reference
