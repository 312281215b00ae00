// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calibration/camera_clock.h"
#include "calibration/light_detector.h"
#include "calibration/report.h"

namespace lf {

struct LightSolution {
  Tracks tracks;                 // lights at common instants, without reflections
  std::vector<double> instants;  // true times of the positions of `tracks`, seconds
  Solution solution;
  std::vector<CameraClock> clocks;  // per camera, relative to the median of the known offsets
  std::vector<size_t> reflections;  // number of rejected reflections of each camera
  double reach = 0;                 // largest clock difference that was searched, seconds

  double seconds() const { return instants.empty() ? 0 : instants.back() - instants.front(); }
};

struct LightSolveOptions {
  SolveOptions solve;
  double reach = 10;  // largest difference of clocks, or of the starts of recordings, seconds
};

// Estimates cameras and clocks. Throws Error if there is no solution.
LightSolution solve_lights(const LightDetections& sights, const LightSolveOptions& options);

std::vector<Finding> diagnose_clocks(const LightSolution& solution);

// Adds members to the cameras of a calibration_report(). If the clock is known, these are "time_offset_ms",
// "time_offset_sigma_ms", "clock_drift_ppm", and "dropped_frames" (a list of {"stamp", "frames"}). "reflections" is
// always the number of rejected reflections.
void add_clocks(const LightSolution& solution, nlohmann::ordered_json& report);

// Quality of the recording of one camera, judged without other cameras.
struct LightSummary {
  double seconds = 0;
  double lit = 0;                      // share of the frames with a light
  double coverage = 0;                 // share of the image's 4 x 3 cells that a moving light has visited
  double sigma = 0;                    // median standard deviation of the brightest light's position, pixels
  std::optional<std::string> trouble;  // why the recording is unusable, and the remedy
  std::vector<std::string> remarks;    // possible improvements
};
LightSummary summarize_lights(const LightDetections::Camera& camera, const LightDetectorStats& record);

std::vector<Finding> compare_recordings(const LightDetections& sights);

}  // namespace lf
