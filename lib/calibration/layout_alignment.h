// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <vector>

#include "calibration/adjustment.h"

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

}  // namespace lf
