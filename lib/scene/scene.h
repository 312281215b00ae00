// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "image/image.h"
#include "rig/rig.h"
#include "view/view.h"

namespace lf {

// The built-in scene: analytic, dynamic, in front of the array of scene_rig(). Ray-traced per pixel, so that any lens
// and pose at any time has an exact ground truth. Pictures are a pure function of the arguments: every machine films
// the same scene.
struct Rgb {
  double r, g, b;  // 0..255, gamma-encoded
};

// What the ray from `origin` (world, metres) along `direction` (any length > 0) sees at `time` seconds.
Rgb scene_colour(const Vec3& origin, const Vec3& direction, double time);

struct SceneCamera {
  int width, height;
  Lens lens;
  Pose pose;
};
// What a sensor behind the lens records: light averaged over each pixel, then gamma-encoded. A pixel takes one ray
// through its middle (textures are filtered in closed form over its footprint), and samples x samples rays on a regular
// grid where it differs from a neighbour in object or contrast, or `everywhere`. Rays that the lens does not see are
// black. Single-threaded; throws Error if samples < 1.
Image render_scene(const SceneCamera& camera, double time, int samples = 2, bool everywhere = false);

// Pictures of one camera at successive instants, identical to those of render_scene(). A pixel is traced again only if
// an object has moved in front of it or into its light since the previous picture. Not thread-safe.
class SceneFilm {
 public:
  explicit SceneFilm(const SceneCamera& camera, int samples = 2);
  ~SceneFilm();
  Image at(double time);

 private:
  friend Image render_scene(const SceneCamera& camera, double time, int samples, bool everywhere);
  struct State;
  std::unique_ptr<State> state_;
};

// The array the scene was made for: rows x columns cameras of width x height in the plane z = 0 around the origin,
// looking along +z.
Rig scene_rig(int rows = 8, int columns = 8, int width = 320, int height = 240);

// Metres between neighbouring cameras of scene_rig(), along rows and columns.
inline constexpr double kScenePitch = 0.04;
// Everything moves with this period, seconds: a film of one period loops without a seam.
inline constexpr double kScenePeriod = 4.0;
// Depths (metres along +z) at which the scene has something to focus on, near to far.
inline constexpr double kSceneNear = 1.2, kSceneMiddle = 2.2, kSceneFar = 4.5;

}  // namespace lf
