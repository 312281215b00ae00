// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "calibration/report.h"
#include "calibration/tracks.h"

namespace lf {

// The result of checking whether a calibrated rig still matches its cameras, with a later recording of a moving light.
// Copyable.
struct RigCheck {
  enum class State {
    kHolds,
    kMoved,  // position or orientation has changed
    kLens,   // the focal length has changed because focus or zoom was turned
    kUnknown,
  };
  struct Camera {
    uint32_t id = 0;
    State state = State::kUnknown;
    size_t sights = 0;       // number of observations of lights that other cameras locate
    double residual_px = 0;  // median with the calibration of the rig
    double shift_px = 0;
    // Change of the pose, along and about the camera's axes (x right, y down, z forward), with standard deviations.
    Vec3 move{0, 0, 0}, move_sigma{0, 0, 0};  // metres
    Vec3 turn{0, 0, 0}, turn_sigma{0, 0, 0};  // radians
    double focal_change = 0;                  // relative; 0 unless the state is kLens
  };
  std::vector<Camera> cameras;  // in the order of the tracks
  size_t lights = 0;
  double residual_px = 0;  // median residual of the cameras that hold
  double shift_px = 0;     // median image displacement of these cameras
  // True if so many cameras are off that it is unknown which of them have moved. The rig must then be calibrated again.
  bool is_lost = false;
  std::optional<double> bar;  // median distance between the two lights in the scale of the rig, metres
  std::optional<double> bar_spread;

  bool holds() const;  // true if all cameras with enough observations hold
};

// Largest image displacement of a camera that still matches the rig, in pixels.
inline constexpr double kMinShift = 0.3;

// Checks a rig against new tracks. Triangulates the lights with cameras that agree, and estimates the pose of each
// camera from these lights. `tracks` are at common instants; cameras are matched by id. Throws Error if a camera is not
// in the rig or has another image size, or if no three cameras see the light together.
RigCheck check_calibration(const Rig& rig, const Tracks& tracks);

// Returns the problems and their remedies, with the codes moved-camera, changed-lens, unseen-camera, rig-lost, rig-off
// and wrong-scale. `bar_length` is the true length of the bar in metres; 0: unknown.
std::vector<Finding> diagnose_check(const Rig& rig, const RigCheck& check, double bar_length);

// Returns the report as JSON:
// {"format": "lightfield-check", "version": 1, "from": "tracks", "holds", "lights", "residual_px", "shift_px",
// "bar_metres" (with a bar), "findings", "cameras": [{"id", "name", "state", "sights", "residual_px", "shift_px",
// "move_mm": [x, y, z], "move_sigma_mm", "turn_deg": [x, y, z], "turn_sigma_deg", "focal_change"}]}.
nlohmann::ordered_json check_report(const Rig& rig, const RigCheck& check, const std::vector<Finding>& findings);

}  // namespace lf
