// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calibration/solve.h"

namespace lf {

// Assignment of cameras to the places of a nominal layout.
struct LayoutAlignment {
  Similarity layout_from_scene;
  // Unique place of each camera; its nominal place, unless it is clearly at another camera's place.
  std::vector<size_t> place;
  std::vector<char> fits;     // true: near its place
  double position_sigma = 0;  // deviation from the places, per axis; units of the layout
  double turn_sigma = 0;      // radians, per axis
};

// Aligns `found` with `layout`; own[i] is the nominal place of camera i. Centres and orientations are weighted by their
// deviations from the layout, which are estimated iteratively. `common_turn`: sigma of the common rotation of all
// orientations relative to the centres, radians. `scale`: fixed, or estimated if nullopt.
//
// Handles wrong camera order. If most cameras fit the layout under their own names, the other cameras are matched with
// each other's places. Otherwise, if the viewing directions fit the layout, all cameras are matched by position
// (iterated closest points).
LayoutAlignment align_to_layout(const std::vector<Pose>& found, const std::vector<Pose>& layout,
                                const std::vector<size_t>& own, std::optional<double> scale, double common_turn);

// Inputs for the scale of a solution, which images do not determine.
struct PlacementOptions {
  double pitch = 0;       // median distance between nearest neighbours, metres; 0: unknown
  double bar_length = 0;  // distance between the two lights, metres; 0: unknown
  struct Distance {
    uint32_t a, b;  // camera ids
    double metres;
  };
  std::optional<Distance> distance;
};

struct Placement {
  Similarity world_from_scene;
  std::string scale_from;  // "the bar's length", "the pitch", ...; empty: unknown scale, neighbours are 1 apart
  // For each camera of the tracks, the id of the prior rig's camera at its place; its own id if the order is correct.
  // Empty without a layout.
  std::vector<uint32_t> stands_at;
};

// Determines scale and frame. Sources of scale, in order: the bar, the distance between two cameras, the pitch, the
// prior rig's layout. The frame aligns centres and orientations with the prior rig (align_to_layout()). Without a prior
// rig, the origin is at the centre of the cameras, z is their viewing direction, and x points to their right. Throws
// Error if a camera is missing or a distance is not positive.
Placement place_solution(const Solution& solution, const Tracks& tracks, const SolveOptions& options,
                         const PlacementOptions& placement);

// Returns the median distance between nearest neighbours.
double neighbour_distance(const std::vector<Pose>& poses);

// Returns the placed cameras as a rig, with names, sources and topology of the prior rig, if any. Cameras are ordered
// by their places, because a topology refers to this order.
Rig make_rig(const Solution& solution, const Tracks& tracks, const SolveOptions& options, const Placement& placement);

// Returns the "covariance" entry of a rig file for camera `index` of the tracks, in the rig's frame and scale. The
// camera must be used.
CameraCovariance covariance_in_rig(const Uncertainty& uncertainty, size_t index, const Similarity& world_from_scene);

}  // namespace lf
