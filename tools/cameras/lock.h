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
  double settle = 4;            // seconds that automatic controls get, and pictures after a change
  double patience = 10;         // seconds until cameras give frames
  std::string path = {};        // file that the rig was read from
  bool trusted = false;         // the rig may run any element, see rig/source_security.h
  std::optional<double> mains;  // hertz of the mains: exposures become whole half-waves, against flicker
};

// A camera that does not work, in the light field's words.
struct CameraFailure : Error {
  using Error::Error;
};

// Opens the reference camera with its controls left to itself, and returns what it has chosen: exposure, gain, white
// balance, focus, as far as its source has them. Throws CameraFailure where the
// camera does not work, Error where it tells nothing.
ControlValues choose_controls(const Rig& rig, const LockOptions& options);

// An exposure (seconds) as a whole number of half-waves of mains, if it has room for one.
double without_flicker(double exposure, double mains);

// A camera whose control changes nothing in its picture.
struct StuckControl {
  CameraIndex camera = 0;
  std::string control;
  std::string why;  // "the picture stays the same", "its source does not take it", or why the camera does not work
};
// Opens all cameras with `controls`, and once more for each of them with another value, and compares pictures:
// exposure and gain by brightness, white balance by colour. Focus is not judged. `on_step` is told what is tried.
std::vector<StuckControl> find_stuck_controls(const Rig& rig, const ControlValues& controls, const LockOptions& options,
                                              const std::function<void(const std::string&)>& on_step = {});

}  // namespace lf::cameras
