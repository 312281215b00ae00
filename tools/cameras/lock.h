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
  double settle = 4;      // time for automatic controls to converge, and for frames to show a change, seconds
  double timeout = 10;    // maximum time until the first frame of each camera, seconds
  std::string path = {};  // file of the rig
  bool trusted = false;
  // Mains frequency of the lamps, hertz. Exposures become multiples of half its period, the period of the flicker.
  std::optional<double> mains;
};

// Thrown if a camera does not work. The message comes from lfcamsrc.
struct CameraFailure : Error {
  using Error::Error;
};

// Opens the reference camera with automatic controls and returns the values that it chooses for exposure, gain, white
// balance and focus. Throws CameraFailure if the camera does not work, and Error if it reports no values.
ControlValues choose_controls(const Rig& rig, const LockOptions& options);

// Rounds an exposure (seconds) to whole half periods of the mains frequency, so that lamps do not flicker in the
// images. Exposures shorter than half a period stay unchanged.
double flicker_free_exposure(double exposure, double mains);

struct StuckControl {
  CameraIndex camera = 0;
  std::string control;
  std::string why;  // for example "the picture stays the same", or the error of the camera
};
// Finds cameras that ignore a control, as many webcams do. The function opens all cameras with `controls`, and then
// again for each control with another value of this control. An exposure or gain with an effect changes the brightness
// of the image, and a white balance changes its colour. Focus is not checked. `on_step` receives a description of each
// step.
std::vector<StuckControl> find_stuck_controls(const Rig& rig, const ControlValues& controls, const LockOptions& options,
                                              const std::function<void(const std::string&)>& on_step = {});

}  // namespace lf::cameras
