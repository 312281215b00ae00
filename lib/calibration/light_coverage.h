// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calibration/light_detector.h"
#include "calibration/picture_places.h"
#include "rig/rig.h"

namespace lf {

// Where a moved light, or a bar with two, has come to in the pictures of an array, while it is being filmed, and where
// it is to go next.
//
// Depths are those of the array as it was planned: good enough to tell near from far, whatever the true lenses and
// poses are. A camera's depth at the time of a look at another camera is by both their lines of sight, its own taken
// between two looks. Not thread-safe.
class LightCoverage {
 public:
  // `lights`: how many are moved; the brightest are taken for them. Throws Error where there are none.
  LightCoverage(const Rig& rig, int lights);

  // What a camera showed at `time`, seconds; looks may be far apart (a few a second will do), and times of a camera
  // grow. Cameras that were never looked at ask for nothing.
  void look(CameraIndex camera, double time, const std::vector<Sight>& sights);

  const PicturePlaces& places(CameraIndex camera) const { return cameras_[camera].places; }
  // How the light must move along a camera's axis, so that it has been near and far: "nearer", "farther", or "" where
  // it has, or where nothing is known of its depth yet.
  std::string depth_wanted(CameraIndex camera) const;
  // "upper left, lower left, nearer"; "" where a camera lacks nothing.
  std::string wanted(CameraIndex camera) const;
  // For the person with the light, in one line: how far it is, what most cameras lack, and which ones lack most.
  // "The light came to 61 % of the pictures. Next: upper left (40 cameras), nearer (3 cameras). Camera 12 (cam_01_04)
  // 25 %: upper left, lower left, nearer."
  std::string told() const;

 private:
  struct Look {
    double time = 0;
    Vec2 pixel{0, 0};  // middle of the lights
  };
  struct Camera {
    explicit Camera(const lf::Camera& planned) : places(planned.width, planned.height) {}
    PicturePlaces places;
    size_t looks = 0;
    bool lit = false;
    std::optional<Look> last;    // the last look, where all lights were seen
    std::vector<double> depths;  // metres along its axis, in no order
  };
  std::string most_wanted(CameraIndex camera) const;
  // The light between two looks of a camera, with the last look of another one.
  void measure_depth(CameraIndex camera, const Look& before, const Look& now);

  Rig rig_;
  size_t lights_;
  double size_ = 0;  // metres from camera to camera, the farthest
  std::vector<Camera> cameras_;
};

}  // namespace lf
