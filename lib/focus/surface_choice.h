// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "focus/moments.h"
#include "focus/trial.h"

namespace lf {

// What trials say about the surface they were made of.
struct SurfaceChoice {
  std::vector<uint8_t> levels;  // of the better surface, one for each node
  double residual = 0;          // median deviation through the smoothed surface, levels of luma; NaN: nothing is seen
  double gained = 0;            // by how much the choice lowers it, mean over the nodes
  double changed = 0;           // fraction of the nodes that left the smoothed surface
  std::vector<uint8_t> chosen;  // trial of each node; 0: the smoothed surface
  std::vector<float> least;     // deviation through it; infinity: the node is not seen
  float lead = 0;               // of the smoothed surface
  std::vector<double> cost;  // of each trial: mean deviation over the nodes that all of them see; NaN: there are none
};

// The level, for each node, of the trial through which the cameras agree best: where the deviation, averaged over
// `radius` nodes around, is smallest. The smoothed surface (trials[0]) has a lead of kLead of the median deviation: against flicker
// where nothing tells surfaces apart. Nodes that no trial sees keep their
// level; a trial that fewer cameras see than another does not compete there. `trials`: levels of each.
inline constexpr double kLead = 0.06;
SurfaceChoice choose_surface(const FocalMap& surface, std::span<const std::vector<uint8_t>> trials,
                             std::span<const Moments> moments, int radius = 1);

}  // namespace lf
