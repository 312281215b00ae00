// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/maths.h"
#include "image/image.h"
#include "rig/rig.h"
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

// A chart of 24 colours (image/colour_correction.h) that is held before an array, in front of a grey wall, for cameras'
// colours to be compared on it.
struct ChartPose {
  Pose world_from_chart;  // the chart's middle; x to its right, y down, z away from who reads it
  double width = 0.3;     // metres that the chart's black border is wide
};

// `count` places to hold the chart at: over the image of the camera in the middle from place to place, so that all
// cameras see the chart near their middle and at their edges, turned a little, and about half as wide as that image.
std::vector<ChartPose> chart_poses(const Rig& rig, int count);

// What a camera without faults records: light averaged over each pixel, encoded as render_scene() does. Rays that the
// lens does not see are black.
Image render_chart(const SceneCamera& camera, const ChartPose& chart);

// What a camera makes of the picture that a camera without faults takes: light goes through its lens and its colour
// filters, is exposed, encoded, and has noise.
struct ColourFault {
  double gain = 1;        // factor of levels: the light's to the power of 1 / `gamma`
  Vec3 balance{1, 1, 1};  // gains of the channels, beside `gain`
  Vec3 black{0, 0, 0};    // levels without light
  double gamma = 2;       // encodes light with 1 / gamma; the scene has 2
  std::array<double, 9> crosstalk{1, 0, 0, 0, 1, 0, 0, 0, 1};  // matrix of light, row by row; rows sum to 1
  std::array<double, 2> vignetting{0, 0};                      // share of the light: see ColourModel
  double noise = 0;                                            // standard deviation, levels
};

// How far faults of cameras go: uniform between plus and minus of each.
struct ColourFaultOptions {
  double gain = 0.08, balance = 0.05;  // parts of levels
  double black = 4;                    // levels; all cameras have as many more
  double gamma = 0.03;                 // part of the exponent
  double crosstalk = 0.03;             // part of light that goes from one channel into another: from 0 up
  double vignetting = 0.3;             // part of light lost half a diagonal from the middle: from half of this up
  double noise = 3;                    // levels
};

// Faults for as many cameras: the same for the same seed on every machine.
std::vector<ColourFault> random_faults(size_t cameras, uint32_t seed, const ColourFaultOptions& options = {});
// An exposure that is stuck: levels are so many times as high.
inline constexpr double kStuckGain = 1.6;

// An RGB image of the scene as the camera gives it. `seed`: of its noise.
Image with_fault(const Image& rgb, const ColourFault& fault, const Vec2& principal_point, uint64_t seed);

// {"format": "lightfield-colour-faults", "version": 1, "cameras": [{"id", "gain", "balance", ...}]}: the truth about a
// film.
std::string faults_to_json(const Rig& rig, const std::vector<ColourFault>& faults);

}  // namespace lf
