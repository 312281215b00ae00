// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calibration/camera_clock.h"
#include "calibration/light_detector.h"
#include "calibration/report.h"

namespace lf {

// A light or a reflection that one camera sees at one instant, according to its clock.
struct LightCandidate {
  uint32_t camera = 0, path = 0;  // `path`: index of a path of the camera
  PathSample place;
  double brightness = 0;  // relative to the median path of the camera
};
using LightCandidates = std::vector<LightCandidate>;
std::vector<LightCandidates> candidates_at(const std::vector<std::vector<LightPath>>& paths,
                                           const std::vector<double>& frame_times,
                                           const std::vector<CameraClock>& clocks, const std::vector<double>& instants);

// Tracks with one position per instant, and the candidate behind each observation.
struct LightAssociation {
  Tracks tracks;
  std::vector<LightCandidate> made_of;
  std::vector<size_t> reflections;  // per camera, number of candidates that are reflections
};

// Assigns the brightest candidates to the lights, without geometry. The direction of the bar identifies its lights:
// between camera `reference` and any other camera, directions map like velocities. Only instants at which camera
// `reference` sees both lights of a bar get observations.
LightAssociation associate_by_brightness(const Tracks& cameras, const std::vector<LightCandidates>& candidates,
                                         size_t reference);

// Assigns a light to points where all used cameras agree within `reach` pixels. The two points of a bar must be one bar
// length (the unit of length) apart. Reflections in a flat window form such points too: the brighter point is the
// light, and a path that is a reflection in most instants is excluded completely.
LightAssociation associate_by_geometry(const Tracks& cameras, const std::vector<LightCandidates>& candidates,
                                       const std::vector<CameraState>& states, double reach);

// Cameras and clocks estimated from detections of a moving light.
struct LightSolution {
  Tracks tracks;                 // lights at common instants, without reflections
  std::vector<double> instants;  // true times of the positions of `tracks`, seconds
  Solution solution;
  std::vector<CameraClock> clocks;  // per camera; the median of the known offsets is 0
  std::vector<size_t> reflections;  // per camera, number of rejected reflections
  double reach = 0;                 // search range of the clocks, seconds

  double seconds() const { return instants.empty() ? 0 : instants.back() - instants.front(); }
};

struct LightSolveOptions {
  SolveOptions solve;
  double reach = 10;  // maximum difference of clocks, or of recording starts, seconds
};

// Estimates cameras and clocks. Light positions between stamps come from cubic interpolation. Initial clocks are
// estimated from the similarity of light motions, then refined together with the geometry. Throws Error if there is no
// solution.
LightSolution solve_lights(const LightDetections& sights, const LightSolveOptions& options);

// Returns the problems of clocks and detections, in addition to diagnose().
std::vector<Finding> diagnose_clocks(const LightSolution& solution);

// Adds to the cameras of a calibration_report(): "time_offset_ms", "time_offset_sigma_ms", "clock_drift_ppm",
// "dropped_frames" ({"stamp", "frames"} each) if the clock is known, and "reflections", the number of rejected
// reflections.
void add_clocks(const LightSolution& solution, nlohmann::ordered_json& report);

// Quality of one camera's recording, without geometry.
struct LightSummary {
  double seconds = 0;
  double lit = 0;                      // share of the frames with a light
  double coverage = 0;                 // share of the image's 4 x 3 cells that a moving light visited
  double sigma = 0;                    // median standard deviation of the brightest light's position, pixels
  std::optional<std::string> trouble;  // why the recording is unusable, and the remedy
  std::vector<std::string> remarks;    // possible improvements
};
LightSummary summarize_lights(const LightDetections::Camera& camera, const LightDetectorStats& record);

// Returns notes about recordings shorter than the longest.
std::vector<Finding> compare_recordings(const LightDetections& sights);

}  // namespace lf
