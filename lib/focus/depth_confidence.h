// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "geometry/pose.h"

namespace lf {

// Estimates how reliable the depth of each node of a focal surface is: 0 is a guess, 1 is certain. A depth is reliable
// if the cameras agree about it and disagree about other depths. The confidence of a node is
//
//     evidence (1 - (deviation through the surface + noise) / mean deviation through other depths)
//
// limited to 0 to 1. Other depths differ by a pixel or more in neighbouring cameras. Their mean covers the latest
// rounds, because a round of the search tests few of them. Regions without detail have no confidence, because all
// depths fit. Neither have pixels that a single camera determines, see FocusArray::evidence(). A plain value without
// locks.
class DepthConfidence {
 public:
  // The answers to the depth hypotheses of a request, of which the first is the surface itself. `levels` and `costs`
  // (see hypothesis_costs()) have one element for each hypothesis, with one value for each node of `map`.
  struct Round {
    const FocalMap& map;
    std::span<const std::vector<uint8_t>> levels;
    std::span<const std::vector<float>> costs;
    std::span<const float> evidence;
    double levels_a_pixel = 8;  // see FocusArray::levels_a_pixel()
  };
  void add(const Round& round);
  // Returns the confidence of each node as a map with the nodes of the surface, whose FocalMap::inverse_row() returns
  // confidences between the nodes. Level 255 is a confidence of 1. Null before the first round.
  const std::shared_ptr<const FocalMap>& map() const { return map_; }

 private:
  std::vector<float> others_;  // mean deviation through other depths; 0: none was tested yet
  std::shared_ptr<const FocalMap> map_;
};

}  // namespace lf
