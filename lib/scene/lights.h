// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "image/image.h"
#include "scene/scene.h"

namespace lf {

// A light, or two on a rigid bar, that somebody moves through a dark room in front of an array: what recordings for a
// calibration show, with the truth beside. Everything is a pure function of its arguments.

struct LightsOptions {
  double bar = 0.3;             // metres between the two lights; 0: one light
  double near = 0.8, far = 2;   // metres in front of the array: where the middle of the bar is moved
  double speed = 0.5;           // metres a second of the lights, root of the mean square
  double radius = 0.006;        // metres
  double power = 4;             // light of a pixel amid a light's image, 1 m away and at rest: 1 saturates
  double ambient = 0.002;       // share of the built-in scene's own light that is left in the dark room
  double reflection = 0;        // share of the lights that a window behind them reflects
  double exposure = 1.0 / 120;  // seconds; the middle of it is when a picture was taken
  double noise = 3;             // standard deviation of a sample, of 255
};

// The path of the lights for the cameras of one rig. A plain value.
class LightsPath {
 public:
  // Throws Error where the options make no sense ("far: must be more than near").
  LightsPath(const Rig& rig, const LightsOptions& options);

  int num_lights() const { return options_.bar > 0 ? 2 : 1; }
  const LightsOptions& options() const { return options_; }
  // Where a light is in the world, metres. Light 1 is where light 0 is if there is one alone.
  std::array<Vec3, 2> lights(double time) const;
  // The mirror image of a point in the window.
  Vec3 mirrored(const Vec3& point) const { return point - 2 * window_.signed_distance(point) * window_.normal; }

 private:
  LightsOptions options_;
  Pose array_;                       // amid the cameras, along their mean axes
  double half_width_, half_height_;  // what a typical camera sees a metre away
  double rate_ = 1;                  // radians a second that lead to the speed
  Plane window_;
  Vec3 middle(double phase) const;
  Vec3 direction(double phase) const;
  std::array<Vec3, 2> lights_at(double phase) const;
};

// One camera that films moving lights.
class LightsCamera {
 public:
  LightsCamera(const LightsPath& path, const SceneCamera& camera);

  // The picture whose exposure is around `time`; grey, as RGB. `seed`: of its noise, any number, another one for each
  // picture. Gamma 2, as the built-in scene.
  Image picture(double time, uint64_t seed) const;
  // Where the middle of each light's image is, the mean over the exposure; then those of the reflections, where there
  // is a window. Nothing where a light is not in the picture.
  std::vector<std::optional<Vec2>> places(double time) const;

 private:
  struct Spot;
  std::vector<Spot> spots(double time) const;

  LightsPath path_;
  SceneCamera camera_;
  std::vector<float> room_;  // light of the room, a value for each pixel
};

}  // namespace lf
