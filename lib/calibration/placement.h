// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calibration/solve.h"

namespace lf {

// How cameras that were found fit into the places of a nominal layout.
struct LayoutAlignment {
  Similarity layout_from_scene;
  // For each camera that was found the place that it stands at, no two at one: its own where it is not clearly at
  // another's.
  std::vector<size_t> place;
  std::vector<char> fits;     // for each camera whether it is about where its place is
  double position_sigma = 0;  // how far cameras are from their places, one axis; units of the layout
  double turn_sigma = 0;      // radians, one axis
};

// Aligns `found` to `layout`, whose place own[i] is said to be that of camera i. Centres and orientations count by how
// near they are to the layout's, both of which are estimated on the way; `common_turn`: sigma of what all orientations
// are off by together against the centres, radians.
//
// Cameras whose order is wrong take no part at the place that they are said to have: where most cameras fit the layout
// as they are named, the others are looked for at each other's places; where they do not, but look the same ways as
// the layout's, the order of all is found by where they stand (iterated closest points). `scale`: given, or estimated.
LayoutAlignment align_to_layout(const std::vector<Pose>& found, const std::vector<Pose>& layout,
                                const std::vector<size_t>& own, std::optional<double> scale, double common_turn);

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

}  // namespace lf
