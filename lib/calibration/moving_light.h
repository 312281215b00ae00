// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "calibration/camera_clock.h"
#include "calibration/report.h"
#include "calibration/solve.h"

namespace lf {

// Cameras and their clocks from what each saw of a moving light by its own stamps.
struct LightSolution {
  Tracks tracks;                    // the lights at common instants, without reflections
  std::vector<double> instants;     // true times of the positions of `tracks`, seconds
  Solution solution;                // the solution of `tracks`
  std::vector<CameraClock> clocks;  // one for each camera; the median of the known offsets is 0
  std::vector<size_t> reflections;  // for each camera how many reflections were left out
  double reach = 0;                 // seconds that clocks were looked for in

  double seconds() const { return instants.empty() ? 0 : instants.back() - instants.front(); }
};

struct LightSolveOptions {
  SolveOptions solve;
  double reach = 10;  // seconds that cameras' clocks, or the beginnings of their recordings, may differ by
};

// Solves cameras and clocks. Between stamps a light is where the cubic through four of them has it. Clocks are found by
// how alike the lights move in the pictures first, then by the geometry, which is adjusted to them in turn. Throws
// Error where nothing can be found at all.
LightSolution solve_lights(const LightSights& sights, const LightSolveOptions& options);

// What a person must know about clocks and sights, beside what diagnose() says of the solution.
std::vector<Finding> diagnose_clocks(const LightSolution& solution);

// Adds to the cameras of a calibration_report(): "time_offset_ms", "time_offset_sigma_ms", "clock_drift_ppm",
// "dropped_frames" ({"stamp", "frames"} each), where the clock is known, and "reflections", how many were left out.
void add_clocks(const LightSolution& solution, nlohmann::ordered_json& report);

}  // namespace lf
