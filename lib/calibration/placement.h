// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calibration/solve.h"

namespace lf {

// The assignment of cameras to the places of a nominal layout, and the transformation between scene and layout.
struct LayoutAlignment {
  Similarity layout_from_scene;
  // Place of each camera; no place is used twice. This is its nominal place, unless the camera is clearly at another
  // camera's place.
  std::vector<size_t> place;
  std::vector<char> fits;     // true if the camera is near its place
  double position_sigma = 0;  // deviation from the places per axis, in units of the layout
  double turn_sigma = 0;      // radians, per axis
};

// Aligns the poses `found` with the poses `layout`, where own[i] is the nominal place of camera i. Centres and
// orientations are weighted by their deviations from the layout, which are estimated iteratively. `common_turn` is the
// sigma of the common rotation of all orientations relative to the centres, in radians. `scale` is fixed, or estimated
// if nullopt.
//
// The order of the cameras may be wrong. If most cameras fit the layout under their own names, the remaining cameras
// are matched with each other's places. Otherwise, if the viewing directions fit the layout, all cameras are matched by
// position (iterated closest points).
LayoutAlignment align_to_layout(const std::vector<Pose>& found, const std::vector<Pose>& layout,
                                const std::vector<size_t>& own, std::optional<double> scale, double common_turn);

// Known lengths, which determine the scale of a solution.
struct PlacementOptions {
  double pitch = 0;       // median distance between nearest neighbours, metres; 0: unknown
  double bar_length = 0;  // distance between the two lights, metres; 0: unknown
  using Distance = lightfield::CalibrationOptions::Distance;
  std::optional<Distance> distance;
};

struct Placement {
  Similarity world_from_scene;
  // the length that was used ("the bar's length", "the pitch", ...); empty: no length, neighbours are 1 apart
  std::string scale_from;
  // For each camera of the tracks, the id of the camera of the prior rig at its place; its own id if the order is
  // correct. Empty without a layout.
  std::vector<uint32_t> stands_at;
};

// Determines the scale and the frame of a solution. The scale comes from the bar, the distance of two cameras, the
// pitch, or the layout of the prior rig. The first known source is used. The frame is the frame of the prior rig (see
// align_to_layout()). Without a prior rig, the origin is the centre of the cameras, z their viewing direction, and x
// points to their right. Throws Error if a camera is missing or a distance is not positive.
Placement place_solution(const Solution& solution, const Tracks& tracks, const SolveOptions& options,
                         const PlacementOptions& placement);

double neighbour_distance(const std::vector<Pose>& poses);

// Returns the placed cameras as a rig, with names, sources and topology of the prior rig, if any. The cameras are
// ordered by their places in the layout, because a topology refers to this order.
Rig make_rig(const Solution& solution, const Tracks& tracks, const SolveOptions& options, const Placement& placement);

// Returns the covariance of camera `index` of the tracks, in the format of the "covariance" entry of a rig file and in
// the frame and scale of the rig. The camera must be used.
CameraCovariance covariance_in_rig(const Uncertainty& uncertainty, const Reconstruction& scene, size_t index,
                                   const Similarity& world_from_scene);

}  // namespace lf
