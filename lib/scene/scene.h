// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "image/image.h"
#include "rig/rig.h"
#include "view/view.h"

namespace lf {

// The built-in scene: analytic, dynamic, in front of the array of scene_rig(). Ray-traced per pixel, so that any lens
// and pose at any time has an exact ground truth. Pictures are pure functions of the arguments and identical on every
// machine.
struct Rgb {
  double r, g, b;  // 0..255, gamma-encoded
};

// Returns the colour that the ray from `origin` (world, metres) along `direction` (any length > 0) sees at `time`
// seconds.
Rgb scene_colour(const Vec3& origin, const Vec3& direction, double time);

struct SceneCamera {
  int width, height;
  Lens lens;
  Pose pose;
};
// Renders the picture of a sensor behind a lens: light averaged over each pixel, then gamma-encoded. A pixel takes one
// ray through its middle, with textures filtered in closed form over its footprint. Pixels that differ from a neighbour
// in object or contrast, or all pixels with `everywhere`, take samples x samples rays on a regular grid. Rays outside
// of the lens are black. Single-threaded. Throws Error if samples < 1.
Image render_scene(const SceneCamera& camera, double time, int samples = 2, bool everywhere = false);

// Renders pictures of one camera at successive times, identical to render_scene(). Traces a pixel again only if an
// object has moved in front of it or into its light since the previous picture. Not thread-safe.
class SceneRenderer {
 public:
  explicit SceneRenderer(const SceneCamera& camera, int samples = 2);
  ~SceneRenderer();
  Image at(double time);

 private:
  friend Image render_scene(const SceneCamera& camera, double time, int samples, bool everywhere);
  struct State;
  std::unique_ptr<State> state_;
};

// Returns the array that the scene was made for: rows x columns cameras of width x height in the plane z = 0 around the
// origin, looking along +z.
Rig scene_rig(int rows = 8, int columns = 8, int width = 320, int height = 240);

// Distance between neighbouring cameras of scene_rig() along rows and columns, metres.
inline constexpr double kScenePitch = 0.04;
// Period of all movements, seconds: a recording of one period loops seamlessly.
inline constexpr double kScenePeriod = 4.0;
// Depths of objects to focus on, metres along +z.
inline constexpr double kSceneNear = 1.2, kSceneMiddle = 2.2, kSceneFar = 4.5;

}  // namespace lf
