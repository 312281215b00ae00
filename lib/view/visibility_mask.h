// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "view/depth_edges.h"

namespace lf {

// Shows which part of a view's focal surface a camera sees, with a value for each node of the view's focal map. The
// camera's weight is multiplied by the value, interpolated bilinearly between nodes, and the rest counts as missing
// weight. Where something hides the surface from the camera, other cameras therefore determine the colour.
struct VisibilityMask {
  static constexpr uint8_t kVisible = 255;
  // The surface is hidden. The camera keeps an eighth of its weight, for points that no camera sees.
  static constexpr uint8_t kHidden = 32;

  int columns = 0, rows = 0;   // as in the focal map
  std::vector<uint8_t> nodes;  // row by row, kHidden to kVisible
  // For each of DepthEdges::cells, the values of its pixels. Empty if the view has no DepthEdges.
  std::vector<std::array<uint8_t, DepthEdges::kPixels>> edges;
};

}  // namespace lf
