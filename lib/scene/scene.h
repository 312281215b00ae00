// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <vector>

#include "image/image.h"
#include "rig/rig.h"
#include "view/view.h"

namespace lf {

// The built-in scene, which moves in front of the array of scene_rig(). It is described by formulas and ray-traced for
// each pixel, so there is an exact ground truth for any lens and pose at any time. Pictures are pure functions of the
// arguments and identical on every machine.
struct Rgb {
  double r, g, b;  // 0..255, gamma-encoded
};

// Returns the colour that a ray sees at `time` seconds. The ray starts at `origin` (world, metres) and has a
// `direction` of any length > 0.
Rgb scene_colour(const Vec3& origin, const Vec3& direction, double time);

struct SceneCamera {
  int width, height;
  Lens lens;
  Pose pose;
};
// Renders the picture of a sensor behind a lens: light is averaged over each pixel and then gamma-encoded. A pixel
// takes one ray through its middle, and textures are filtered in closed form over its footprint. Pixels that differ
// from a neighbour in object or contrast take samples x samples rays on a regular grid; with `everywhere`, all pixels
// do. Rays outside the lens are black. Runs in the calling thread. Throws Error if samples < 1.
Image render_scene(const SceneCamera& camera, double time, int samples = 2, bool everywhere = false);

// Renders the pictures of one camera at successive times, with the same result as render_scene(). For speed, a pixel is
// traced again only if an object has moved in front of it or into its light since the previous picture. Not
// thread-safe.
class SceneRenderer {
 public:
  SceneRenderer(const SceneCamera& camera, std::vector<double> times, int samples = 2);
  ~SceneRenderer();
  // Returns the picture at the next time. May be called once for each time.
  Image next();

 private:
  friend Image render_scene(const SceneCamera& camera, double time, int samples, bool everywhere);
  struct State;
  std::unique_ptr<State> state_;
};

// Returns the array that the scene was made for: rows x columns cameras of width x height pixels, in the plane z = 0
// around the origin, looking along +z.
Rig scene_rig(int rows = 8, int columns = 8, int width = 320, int height = 240);

// Distance between neighbouring cameras of scene_rig() along rows and columns, metres.
inline constexpr double kScenePitch = 0.04;
// Period of all movements in seconds. A recording of one period loops seamlessly.
inline constexpr double kScenePeriod = 4.0;
// Depths of objects to focus on, metres along +z.
inline constexpr double kSceneNear = 1.2, kSceneMiddle = 2.2, kSceneFar = 4.5;

}  // namespace lf
