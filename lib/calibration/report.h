// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "calibration/placement.h"

namespace lf {

// What a person must know about a calibration.
struct Finding {
  enum class Severity { kNote, kWarning, kError };
  Severity severity;
  std::string code;  // for programs: "swapped-cameras"
  std::string text;
};

// {"format": "lightfield-calibration", ..., "mean_px", "median_px", "rms_px": over every observation of a light that
// was found by a camera that was found; "expected_rms_px": what noise alone would leave; "observations": all given,
// "unplaced": those of them without a residual; "outliers"; "inliers": {"mean_px", ...}; "model"; "models": trials;
// "disagreement_of_halves" (where they were compared); "scale_from"; "findings"; "cameras": [{"id", "found",
// "observations", "outliers", "rms_px"}]}.
nlohmann::ordered_json calibration_report(const Solution& solution, const Tracks& tracks, const Placement& placement,
                                          const std::vector<Finding>& findings);

// What a rig file says beside the rig of make_rig(), as save_rig() takes it: of each camera that was found what
// `original` (a parsed rig file, or an empty object) says of it, with its covariance in place of one that is there; and
// that `program` has calibrated it.
nlohmann::json rig_record(const Solution& solution, const Tracks& tracks, const Placement& placement,
                          nlohmann::json original, const std::string& program);

}  // namespace lf
