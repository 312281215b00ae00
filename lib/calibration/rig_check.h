// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "calibration/report.h"
#include "calibration/tracks.h"

namespace lf {

// Whether cameras still are where a rig says, by a later recording of a moving light. A plain value.
struct RigCheck {
  enum class State {
    kHolds,
    kMoved,    // the camera stands or looks elsewhere
    kLens,     // the focal length has changed: somebody turned focus or zoom
    kUnknown,  // too little of the light was seen
  };
  struct Camera {
    uint32_t id = 0;
    State state = State::kUnknown;
    size_t sights = 0;       // sights of lights that the other cameras place
    double residual_px = 0;  // median residual with the camera as the rig has it, pixels
    double shift_px = 0;     // how far its picture has moved: median over its sights
    // What became of its pose, along and about its own axes (x right, y down, z forward), with standard deviations.
    Vec3 move{0, 0, 0}, move_sigma{0, 0, 0};  // metres
    Vec3 turn{0, 0, 0}, turn_sigma{0, 0, 0};  // radians
    double focal_change = 0;                  // relative change of the focal length; 0 unless the state is kLens
  };
  std::vector<Camera> cameras;  // the cameras of the tracks, in their order
  size_t lights = 0;            // places of a light that were compared
  double residual_px = 0;       // median of the residuals of cameras that hold
  double shift_px = 0;          // median of what these cameras' pictures have moved by: what the rig is off as a whole
  // Whether so many cameras are off that nothing tells which: the rig has to be calibrated anew.
  bool is_lost = false;
  std::optional<double> bar;         // metres between the two lights as the rig has them, the median
  std::optional<double> bar_spread;  // standard deviation of these distances

  bool holds() const;  // whether every camera holds, as far as it is known
};

// Pictures that move by less hold, in pixels.
inline constexpr double kLeastShift = 0.3;

// The cameras as most of them agree on where the light was; those that do not are placed anew beside them. `tracks`: at
// common instants, cameras found in the rig by id. Throws Error where a camera is not in the rig or has another size,
// and where no three cameras see the light together.
RigCheck check_calibration(const Rig& rig, const Tracks& tracks);

// What a person must know, and do: moved-camera, changed-lens, unseen-camera, rig-lost, rig-off, wrong-scale
// (`bar_length`, metres, is what it should be; 0: not known).
std::vector<Finding> diagnose_check(const Rig& rig, const RigCheck& check, double bar_length);

// {"format": "lightfield-check", "version": 1, "from": "tracks", "holds", "lights", "residual_px", "shift_px",
// "bar_metres" (where there is one), "findings", "cameras": [{"id", "name", "state", "sights", "residual_px",
// "shift_px", "move_mm": [x, y, z], "move_sigma_mm", "turn_deg": [x, y, z], "turn_sigma_deg", "focal_change"}]}.
nlohmann::ordered_json check_report(const Rig& rig, const RigCheck& check, const std::vector<Finding>& findings);

}  // namespace lf
