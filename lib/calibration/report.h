// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "calibration/placement.h"

namespace lf {

// What a person must know about a calibration.
struct Finding {
  enum class Severity { kNote, kWarning, kError };
  Severity severity;
  std::string code;  // a name for programs: "swapped-cameras"
  std::string text;
};

// "note", "warning" or "error", as reports say it.
const char* name_of(Finding::Severity severity);

// {"format": "lightfield-calibration", ..., "mean_px", "median_px", "rms_px": over every observation of a light that
// was found by a camera that was found; "expected_rms_px": what noise alone would leave; "observations": all given,
// "unplaced": those of them without a residual; "outliers"; "inliers": {"mean_px", ...}; "model"; "models": trials;
// "disagreement_of_halves" (where they were compared); "scale_from"; "findings"; "cameras": [{"id", "found",
// "observations", "outliers", "rms_px", "stands_at": id (where it is another's place)}]}.
nlohmann::ordered_json calibration_report(const Solution& solution, const Tracks& tracks, const Placement& placement,
                                          const std::vector<Finding>& findings);

// What a rig file says beside the rig of make_rig(), as save_rig() takes it: of each camera that was found what
// `original` (a parsed rig file, or an empty object) says of it, with its covariance in place of one that is there; and
// that `program` has calibrated it.
nlohmann::json rig_record(const Solution& solution, const Tracks& tracks, const Placement& placement,
                          nlohmann::json original, const std::string& program);

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

// What pictures of a calibration are drawn from, added to its calibration_report():
// "lights": {"near_m", "far_m"}; "projection": [{"depth_m", "median_px", "worst_px"}]; "soft_modes": [{"code", "text",
// "sigma", "unit", "limit", "soft"}]; "coverage": {"columns", "rows"}; and of each camera that was found "name",
// "width", "height", "position" (metres), "forward", "position_covariance" (3 rows, square metres), "coverage" (how
// many observations fell into each part of its picture, row by row) and "residuals", a sample of them, [x, y, dx, dy]
// pixels.
void add_details(const Solution& solution, const Tracks& tracks, const Placement& placement, const Rig& rig,
                 nlohmann::ordered_json& report);

}  // namespace lf
