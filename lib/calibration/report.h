// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "calibration/adjustment.h"
#include "calibration/solve.h"
#include "calibration/uncertainty.h"

namespace lf {

// What gives a solution its scale and frame, which no image tells.
struct PlacementOptions {
  double pitch = 0;       // metres between neighbours (the median of the distances to the nearest); 0: not known
  double bar_length = 0;  // metres between the two lights; 0: not known
  struct Distance {
    uint32_t a, b;  // ids of the two cameras
    double metres;
  };
  std::optional<Distance> distance;  // the known distance of two cameras
};

struct Placement {
  Similarity world_from_scene;
  std::string scale_from;  // "the bar's length", "the pitch", ...; "" where nothing gives it: neighbours are 1 apart
  // For each camera of the tracks the id of the prior rig's camera whose place it stands at: its own, where the order
  // is right. Empty without a layout.
  std::vector<uint32_t> stands_at;
};

// Scale from what is given (the bar before the two cameras, the pitch, the prior rig's layout), frame from the prior
// rig's layout, centres and orientations (align_to_layout()); without one the origin is amid the cameras, z where they
// look, x to their right. Throws Error where a camera is not there, or a distance is not positive.
Placement place_solution(const Solution& solution, const Tracks& tracks, const SolveOptions& options,
                         const PlacementOptions& placement);

// The median of the distances of poses to the nearest other one.
double neighbour_distance(const std::vector<Pose>& poses);

// The cameras that were found, placed, as a rig: names, sources and topology are the prior rig's where there is one.
// They come in the order of the places where they stand, which a topology counts in.
Rig make_rig(const Solution& solution, const Tracks& tracks, const SolveOptions& options, const Placement& placement);

// What a rig file says as "covariance" of camera `index` of the tracks (which must be used), in the rig's frame and
// scale.
CameraCovariance covariance_in_rig(const Uncertainty& uncertainty, size_t index, const Similarity& world_from_scene);

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

}  // namespace lf
