// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "calibration/camera_clock.h"
#include "calibration/report.h"
#include "calibration/solve.h"

namespace lf {

// Cameras and their clocks from what each saw of a moving light by its own stamps.
struct LightSolution {
  Tracks tracks;                    // at common instants: without reflections
  std::vector<double> instants;     // of its positions: true times, seconds
  Solution solution;                // of these tracks
  std::vector<CameraClock> clocks;  // one a camera; the median of the known offsets is 0
  std::vector<size_t> reflections;  // of each camera: what was left out
  double reach = 0;                 // seconds that clocks were looked for in

  double seconds() const { return instants.empty() ? 0 : instants.back() - instants.front(); }
};

struct LightSolveOptions {
  SolveOptions solve;
  double reach = 10;  // seconds that cameras' clocks, or the beginnings of their recordings, may differ by
};

// Between stamps a light is where the cubic through four of them has it. Clocks first by how alike the lights move in
// the pictures, then by the geometry, which is adjusted to them in turn. Throws Error where nothing can be found at
// all.
LightSolution solve_lights(const LightSights& sights, const LightSolveOptions& options);

// What a person must know about clocks and sights, beside what diagnose() says of the solution.
std::vector<Finding> diagnose_clocks(const LightSolution& solution);

// Into the cameras of a calibration_report(): "time_offset_ms", "time_offset_sigma_ms", "clock_drift_ppm",
// "dropped_frames" ({"stamp", "frames"} each), where the clock is known, and "reflections", how many were left out.
void add_clocks(const LightSolution& solution, nlohmann::ordered_json& report);

}  // namespace lf
