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

// This file simulates recordings for calibration with known ground truth. A light, or two lights on a rigid bar, move
// through a dark room in front of an array. All results are pure functions of the arguments.

struct MovingLightOptions {
  double bar = 0.3;             // metres between the two lights; 0: one light
  double near = 0.8, far = 2;   // range of the bar's middle, metres in front of the array
  double speed = 0.5;           // RMS speed of the lights, metres per second
  double radius = 0.006;        // of a light, metres
  double power = 4;             // light of a pixel in the centre of a light's image, 1 m away and at rest; 1 saturates
  double ambient = 0.002;       // fraction of the built-in scene's light that remains in the dark room
  double reflection = 0;        // fraction of the light that a window behind the lights reflects
  double exposure = 1.0 / 120;  // seconds; the time of a picture is the middle of its exposure
  double noise = 3;             // standard deviation of a sample, of 255
};

// The path of the lights. Their positions are a function of the time, so all cameras see the same movement.
class LightTrajectory {
 public:
  // Throws Error if an option is invalid, for example "far: must be more than near".
  LightTrajectory(const Rig& rig, const MovingLightOptions& options);

  int num_lights() const { return options_.bar > 0 ? 2 : 1; }
  const MovingLightOptions& options() const { return options_; }
  // Returns the positions of the lights in metres. A single light is returned twice.
  std::array<Vec3, 2> lights(double time) const;
  Vec3 mirrored(const Vec3& point) const { return point - 2 * window_.signed_distance(point) * window_.normal; }

 private:
  MovingLightOptions options_;
  Pose array_;                       // mean position and mean axes of the cameras
  double half_width_, half_height_;  // tangents of half the field of view of a typical camera
  double rate_ = 1;                  // radians per second of the path
  Plane window_;
  Vec3 middle(double phase) const;
  Vec3 direction(double phase) const;
  std::array<Vec3, 2> lights_at(double phase) const;
};

// Renders the pictures of one camera that films the moving lights, and knows the true positions of the lights in these
// pictures.
class MovingLightCamera {
 public:
  MovingLightCamera(const LightTrajectory& path, const SceneCamera& camera);

  // Returns a picture of the lights, with the exposure centred at `time`. The picture is grey, stored as RGB, and has
  // gamma 2, like the pictures of the built-in scene. `seed` selects the sensor noise, so use another seed for each picture.
  Image picture(double time, uint64_t seed) const;
  // Returns the mean position of each light's centre during the exposure and the positions of the reflections if there
  // is a window. Lights outside the picture have no value.
  std::vector<std::optional<Vec2>> places(double time) const;

 private:
  struct LightSpot;
  std::vector<LightSpot> spots(double time) const;

  LightTrajectory path_;
  SceneCamera camera_;
  std::vector<float> room_;
};

// A chart of 24 colours (image/colour_correction.h) in front of an array and a grey wall. The chart serves to compare
// the colours of the cameras.
struct ChartPose {
  Pose world_from_chart;  // centre of the chart; x right, y down, z away from the reader
  double width = 0.3;     // outer width of the black border, metres
};

// Returns `count` poses of the chart for colour calibration. The positions cover the image of the middle camera, so
// that all cameras see the chart near their centre and at their edges. The chart is slightly rotated and about half as
// wide as that image.
std::vector<ChartPose> colour_chart_poses(const Rig& rig, int count);

// Renders the chart for a camera without faults. Light is averaged over each pixel and encoded as in render_scene().
// Rays outside the lens are black.
Image render_chart(const SceneCamera& camera, const ChartPose& chart);

// The colour fault of a camera: how its lens, colour filters, exposure, encoding and noise change the picture of a
// perfect camera.
struct ColourFault {
  double gain = 1;        // factor of levels, which is the factor of light to the power of 1 / `gamma`
  Vec3 balance{1, 1, 1};  // gains of the channels, in addition to `gain`
  Vec3 black{0, 0, 0};    // levels without light
  double gamma = 2;       // light is encoded with 1 / gamma; the scene has 2
  std::array<double, 9> crosstalk{1, 0, 0, 0, 1, 0, 0, 0, 1};  // matrix of light, row by row; rows sum to 1
  std::array<double, 2> vignetting{0, 0};
  double noise = 0;  // standard deviation, levels
};

// Ranges of random faults. Each fault is uniform between plus and minus this value, unless noted.
struct ColourFaultOptions {
  double gain = 0.08, balance = 0.05;  // relative to the level
  double black = 4;                    // levels; added to an equal offset of all cameras
  double gamma = 0.03;                 // relative to the exponent
  double crosstalk = 0.03;             // fraction of the light that leaks from one channel into another; from 0 up
  // fraction of the light that is lost half a diagonal from the centre; from half of this value up
  double vignetting = 0.3;
  double noise = 3;  // levels
};

// Returns random faults for `cameras` cameras. The same seed gives the same faults on every machine.
std::vector<ColourFault> random_faults(size_t cameras, uint32_t seed, const ColourFaultOptions& options = {});
// Factor of levels for a camera with a stuck exposure.
inline constexpr double kStuckGain = 1.6;

// Applies a fault to an RGB image of the scene. `seed` is for the noise.
Image apply_fault(const Image& rgb, const ColourFault& fault, const Vec2& principal_point, uint64_t seed);

// Returns the ground truth of a recording: {"format": "lightfield-colour-faults", "version": 1, "cameras": [{"id",
// "gain", "balance", ...}]}.
std::string faults_to_json(const Rig& rig, const std::vector<ColourFault>& faults);

}  // namespace lf
