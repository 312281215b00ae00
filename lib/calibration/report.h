// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <lightfield/calibration.h>
#include <nlohmann/json_fwd.hpp>

#include "calibration/placement.h"

namespace lf {

using lightfield::Finding;

// Returns "note", "warning" or "error", as in reports.
const char* name_of(Finding::Severity severity);
// Returns [{"severity", "code", "text"}, ...].
nlohmann::ordered_json to_json(const std::vector<Finding>& findings);

// Returns the report of a calibration as JSON, for people and for programs. The members are:
// "format": "lightfield-calibration", "version"
// "mean_px", "median_px", "rms_px": reprojection error in pixels, over all observations that have one
// "expected_rms_px": the RMS error that noise alone would cause
// "observations": number of all observations
// "unplaced": number of observations without a reprojection error, because their camera or light has no position
// "outliers": number of observations that contradict the result
// "inliers": {"mean_px", ...}: the errors without outliers
// "model", "models": the selected lens model, and all tested models
// "disagreement_of_halves": only if two halves of the tracks were compared; see disagreement_of_halves()
// "scale_from": the length that determined the scale
// "findings": problems and remarks for the user
// "cameras": [{"id", "found", "observations", "outliers", "rms_px", "stands_at"}], where "stands_at" is the id of
//   another camera if the camera is at the place of that camera
nlohmann::ordered_json calibration_report(const Solution& solution, const Tracks& tracks, const Placement& placement,
                                          const std::vector<Finding>& findings);

// Returns the members of a rig file that a calibration adds to the rig of make_rig(), for save_rig(). `original` is a
// parsed rig file, or an empty object. Each placed camera keeps its members in `original` and gets the new covariance.
// `program` is recorded as the origin.
nlohmann::json rig_record(const Solution& solution, const Tracks& tracks, const Placement& placement,
                          nlohmann::json original, const std::string& program);

// An error that all cameras have in common and that the observations hardly constrain, such as a wrong overall depth.
struct SoftMode {
  std::string code;  // depth, gaze, toe-in, bow, proportions, places, directions
  std::string text;  // description with its size
  double sigma = 0;  // standard deviation, in `unit`
  std::string unit;  // "%", "degrees", "mm"
  double limit = 0;  // if sigma (in `unit`) is larger, a better recording is recommended
  bool is_soft() const { return !(sigma <= limit); }
};

// Returns the weakly constrained modes of a solution: common errors of all cameras that a better recording would
// reduce. Sizes are in the scale of `placement`. The mode with the largest ratio of sigma to limit is first. Some modes
// do not exist in arrays that do not look in one direction.
std::vector<SoftMode> soft_modes(const Solution& solution, const Placement& placement);

// Predicts how precisely the array locates points: the error of projecting a new point into a camera after all other
// cameras have triangulated the point. RMS over image positions in pixels, according to the uncertainty of the
// solution.
struct ProjectionError {
  double depth = 0;              // metres in front of the centre of the array
  double middle = 0, worst = 0;  // errors of the median camera and of the worst camera
};
// Returns the predicted errors at several depths, from half the nearest distance of the light to twice the farthest.
std::vector<ProjectionError> projection_errors(const Solution& solution, const Placement& placement);

// Returns the distances of the light from the centre of the array along its viewing direction, in metres. The range
// excludes the nearest and the farthest 5 % of the positions.
struct LightRange {
  double near = 0, far = 0;
};
LightRange light_range(const Solution& solution, const Placement& placement);

// Adds data for figures to a calibration_report():
// "lights": {"near_m", "far_m"}; "projection": [{"depth_m", "median_px", "worst_px"}]; "soft_modes": [{"code", "text",
// "sigma", "unit", "limit", "soft"}]; "coverage": {"columns", "rows"}. For each camera: "width", "height", "coverage"
// (observations per image cell, row-major) and "residuals", a sample of [x, y, dx, dy] in pixels. For each placed
// camera also "name", "position" (metres), "forward" and "position_covariance" (3 rows, square metres).
void add_details(const Solution& solution, const Tracks& tracks, const Placement& placement, const Rig& rig,
                 nlohmann::ordered_json& report);

}  // namespace lf
