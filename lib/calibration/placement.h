// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <optional>
#include <string>

#include "calibration/adjustment.h"
#include "calibration/solve.h"
#include "calibration/uncertainty.h"

namespace lf {

// What gives a solution its scale and frame, which no image tells.
struct PlacementOptions {
  double pitch = 0;       // metres between neighbours (the median of the distances to the nearest); 0: not known
  double bar_length = 0;  // metres between the two lights; 0: not known
  struct Distance {
    uint32_t a, b;  // ids
    double metres;
  };
  std::optional<Distance> distance;  // between two cameras
};

struct Placement {
  Similarity world_from_scene;
  std::string scale_from;  // "the bar's length", "the pitch", ...; "" where nothing gives it: neighbours are 1 apart
};

// Scale from what is given (the bar before the two cameras, the pitch, the prior rig's layout), frame from the prior
// rig's layout; without one the origin is amid the cameras, z where they look, x to their right. Throws Error where a
// camera is not there, or a distance is not positive.
Placement place_solution(const Solution& solution, const Tracks& tracks, const SolveOptions& options,
                         const PlacementOptions& placement);

// The median of the distances to the nearest other one.
double neighbour_distance(const std::vector<Pose>& poses);

// The cameras that were found, placed, as a rig: names, sources and topology are the prior rig's where there is one.
Rig make_rig(const Solution& solution, const Tracks& tracks, const SolveOptions& options, const Placement& placement);

// As the rig's "covariance" of camera `index` of the tracks (which must be used), in the rig's frame and scale.
CameraCovariance covariance_in_rig(const Uncertainty& uncertainty, size_t index, const Similarity& world_from_scene);

}  // namespace lf
