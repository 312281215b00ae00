// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "calibration/report.h"

namespace lf {

// A way in which all cameras of a solution may be off together, as far as what was seen tells.
struct SoftMode {
  std::string code;  // depth, gaze, toe-in, bow, proportions, places, directions
  std::string text;  // what that would be, in words, with its size
  double sigma = 0;  // one standard deviation, in `unit`
  std::string unit;  // "%", "degrees", "mm"
  double limit = 0;  // a sigma beyond this, in `unit`, is worth a better recording
  bool is_soft() const { return !(sigma <= limit); }
};

// Softest first, by their limits. Of an array that looks about one way; of other rigs those alone that mean something.
// In the scale of `placement`.
std::vector<SoftMode> soft_modes(const Solution& solution, const Placement& placement);

// How far a new point is from where it should appear, when it is placed by all other cameras as they are calibrated
// now: root of the mean square over places in the pictures, pixels, of errors that the solution's uncertainty
// foretells.
struct ProjectionError {
  double depth = 0;              // metres before the array's middle
  double middle = 0, worst = 0;  // the median of all cameras, and the worst
};
// The errors at depths from half the nearest light to twice the farthest.
std::vector<ProjectionError> projection_errors(const Solution& solution, const Placement& placement);

// How far from the array's middle lights were, metres along its gaze: the nearest and the farthest twentieth left away.
struct LightRange {
  double near = 0, far = 0;
};
LightRange light_range(const Solution& solution, const Placement& placement);

}  // namespace lf
