// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calibration/camera_clock.h"
#include "calibration/light_detector.h"
#include "calibration/report.h"

namespace lf {

// A light or a reflection that one camera sees at one instant, according to the clock of the camera.
struct LightCandidate {
  uint32_t camera = 0, path = 0;  // `path`: index of a path of the camera
  PathSample place;
  double brightness = 0;  // relative to the median path of the camera
};
using LightCandidates = std::vector<LightCandidate>;
std::vector<LightCandidates> candidates_at(const std::vector<std::vector<LightPath>>& paths,
                                           const std::vector<double>& frame_times,
                                           const std::vector<CameraClock>& clocks, const std::vector<double>& instants);

// Tracks with one position per instant, and the candidate that each observation comes from.
struct LightAssociation {
  Tracks tracks;
  std::vector<LightCandidate> made_of;
  std::vector<size_t> reflections;  // number of candidates of each camera that are reflections
};

// Assigns candidates to the lights without knowing the cameras: the brightest candidates are the lights. The direction
// of a bar distinguishes its two lights, because directions map from camera `reference` to any other camera like
// velocities. Observations of a bar require that camera `reference` sees both lights.
LightAssociation associate_by_brightness(const Tracks& cameras, const std::vector<LightCandidates>& candidates,
                                         size_t reference);

// Assigns candidates to the lights if the cameras are approximately known: a light is a point where all used cameras
// agree within `reach` pixels. The two points of a bar must be one bar length (the unit of length) apart. Reflections
// in a flat window also form such points. The brighter point is the light, and a path that is a reflection at most
// instants is excluded completely.
LightAssociation associate_by_geometry(const Tracks& cameras, const std::vector<LightCandidates>& candidates,
                                       const std::vector<CameraState>& states, double reach);

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
