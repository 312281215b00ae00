// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calibration/camera_clock.h"
#include "calibration/light_detector.h"
#include "calibration/report.h"

namespace lf {

// What one camera has at one instant by its clock: a light, or a reflection of one.
struct LightCandidate {
  uint32_t camera = 0, path = 0;  // `path`: number of a path of that camera
  PathPlace place;
  double brightness = 0;  // relative to what is usual in that camera
};
using LightCandidates = std::vector<LightCandidate>;
std::vector<LightCandidates> candidates_at(const std::vector<std::vector<LightPath>>& paths,
                                           const std::vector<double>& frame_times,
                                           const std::vector<CameraClock>& clocks, const std::vector<double>& instants);

// Tracks, with a position an instant, and for each of their observations what it was made of.
struct LightAssociation {
  Tracks tracks;
  std::vector<LightCandidate> made_of;
  std::vector<size_t> reflections;  // for each camera how many candidates are none of the lights
};

// Takes the brightest candidates for the lights, without geometry. The two of a bar are told apart by how the bar lies
// in the pictures of camera `reference` and of each other one, which are as linear in each other as the lights' motions
// are; only instants at which that camera sees both have positions with observations.
LightAssociation associate_by_brightness(const Tracks& cameras, const std::vector<LightCandidates>& candidates,
                                         size_t reference);

// Takes points for the lights on which the used cameras agree by their geometry, to `reach` pixels; two of them as far
// apart as a bar is long, where there is a bar (which is the unit of length then). Reflections in a flat window are
// such points, too: of two the brighter one is the light, and a path that is a reflection's more often than not is none
// all along.
LightAssociation associate_by_geometry(const Tracks& cameras, const std::vector<LightCandidates>& candidates,
                                       const std::vector<CameraState>& states, double reach);

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

// What one camera's recording is worth, before any geometry.
struct LightSummary {
  double seconds = 0;
  double lit = 0;                      // share of the pictures in which a light is
  double coverage = 0;                 // share of the picture's places, of 4 x 3, that a moved light came to
  double sigma = 0;                    // median standard deviation of the brightest light's place, pixels
  std::optional<std::string> trouble;  // why the recording is of no use, and what to do about it
  std::vector<std::string> remarks;    // what would make it better
};
LightSummary summarize_lights(const LightSights::Camera& camera, const LightRecord& record);

// What all recordings together show: lengths that differ.
std::vector<Finding> compare_recordings(const LightSights& sights);

}  // namespace lf
