// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/text.h"
#include "rig/rig.h"

namespace lf::cameras {

using ControlValues = std::map<std::string, double>;

struct LockOptions {
  CameraIndex reference = 0;
  double settle = 4;      // seconds for automatic controls to converge, and for frames after a change
  double timeout = 10;    // seconds until cameras must deliver frames
  std::string path = {};  // file that the rig was read from
  bool trusted = false;
  // mains frequency, hertz; exposures become multiples of its half period to avoid flicker
  std::optional<double> mains;
};

// A camera does not work; the message comes from lfcamsrc.
struct CameraFailure : Error {
  using Error::Error;
};

// Opens the reference camera with automatic controls and returns the values it has chosen: exposure, gain, white
// balance and focus, if its source reports these values. Throws CameraFailure if the camera does not work, Error if it
// reports no values.
ControlValues choose_controls(const Rig& rig, const LockOptions& options);

// Rounds an exposure (seconds) to a whole number of mains half periods, if the exposure is not shorter than one.
double flicker_free_exposure(double exposure, double mains);

struct StuckControl {
  CameraIndex camera = 0;
  std::string control;
  std::string why;  // "the picture stays the same", "its picture is black: ...", or the camera's error
};
// Opens all cameras with `controls`, then once for each control with another value, and compares the images: exposure
// and gain by brightness, white balance by colour. Focus is not checked. `on_step` receives a description of each step.
std::vector<StuckControl> find_stuck_controls(const Rig& rig, const ControlValues& controls, const LockOptions& options,
                                              const std::function<void(const std::string&)>& on_step = {});

}  // namespace lf::cameras
