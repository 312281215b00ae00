// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "focus/hypothesis_levels.h"
#include "focus/photo_consistency.h"
#include "geometry/pose.h"

namespace lf {

// The result of select_depths(): the selected depth of each node of the focal map, and measures of its quality. A
// deviation is the standard deviation between the cameras' luma at a node, averaged over nearby nodes, in luma levels.
// A node is informed if its depth is reliable.
struct DepthSelection {
  std::vector<uint8_t> levels;  // levels of the better surface, one per node
  // Median deviation through the smoothed surface, over the nodes with evidence. It is normalised as if three cameras
  // with equal weights contributed to each node. NaN if nothing is visible.
  double residual = 0;
  double gained = 0;              // mean reduction of the nodes' deviations
  std::vector<uint8_t> chosen;    // hypothesis selected at each node; 0: the smoothed surface
  std::vector<float> least;       // deviation through the selected hypothesis; infinity: not visible
  std::vector<std::vector<float>> costs;  // deviation through each hypothesis at each node: see hypothesis_costs()
  std::vector<float> lead;        // advantage of the smoothed surface at each node; see kLead
  std::vector<uint8_t> informed;  // 1: deviations of the hypotheses differ enough for a reliable depth
  // Mean deviation of each hypothesis, over the nodes that all compared hypotheses see. It is NaN if there are no such
  // nodes, and for a hypothesis that sees too few of the surface's nodes to be compared.
  std::vector<double> cost;
  std::vector<double> energy;  // mean squared deviation of each hypothesis over these nodes
  double least_energy = 0;     // mean squared deviation of the selection over the same nodes
};

struct DepthSelectionParams {
  std::span<const float> evidence;  // evidence of each node: see FocusArray::evidence()
  // 1 for each node that counts in DepthSelection::cost, energy and informed. Empty: all nodes count.
  std::span<const uint8_t> counted = {};
  int radius = 1;             // averaging radius of deviations, nodes
  double levels_a_pixel = 8;  // see FocusArray::levels_a_pixel()
  uint32_t jumps = 0;         // bit mask of the hypotheses that are unrelated to the surface: see kJump
};

// Selects the depth of each node of a focal map: the level of the hypothesis that the cameras agree about best. The
// hypothesis should have a small deviation, averaged over nearby nodes, and a level near the levels of the neighbouring
// nodes.
//
// `hypotheses` contains the levels of each hypothesis, and `moments` its sums. hypotheses[0] is the smoothed surface.
// It has an advantage (lead), so that undecided nodes become smooth. The lead is added to the deviation of every other
// hypothesis. It is kLead of the median deviation, plus kNoise, the deviation that the rounding of sums alone can
// cause. A node that differs from its neighbours by a pixel of disparity or more costs kSmooth of the median deviation,
// plus kSmoothNoise.
//
// Nodes with less evidence than kLittleEvidence take the levels of their neighbours. Nodes that no hypothesis sees keep
// their level. A hypothesis does not compete at a node if fewer cameras see it there than another hypothesis. If there
// are kSweep hypotheses or more, the hypotheses from the third on are the planes of a sweep, from far to near.
inline constexpr double kLead = 0.06;
inline constexpr float kNoise = 0.25f, kSmoothNoise = 0.1f;  // levels of luma
inline constexpr double kSmooth = 0.4;
inline constexpr float kLittleEvidence = 0.25f;
// A node is informed (see DepthSelection) under these conditions. It has more evidence than kMinEvidence. Its deviation
// plus kLumaNoise luma levels is less than kMaxDeviationRatio of the deviation at a wrong depth. In a sweep, one of
// many planes can fit by chance. The deviation must then also be less than kUnique of the deviation of every plane that
// is not adjacent to the best plane.
inline constexpr float kLumaNoise = 0.5f, kMaxDeviationRatio = 0.3f, kUnique = 0.6f, kMinEvidence = 0.35f;
inline constexpr size_t kSweep = 7;
// A jump is a hypothesis that is unrelated to the surface, such as a plane far from it (see
// DepthSelectionParams::jumps). A jump is only selected if its deviation is below 1 / kJump of the deviations of all
// other hypotheses. Otherwise one of many successive planes would sometimes fit by chance, and the right level would
// not be tested again.
inline constexpr float kJump = 2;
DepthSelection select_depths(const FocalMap& surface, std::span<const std::vector<uint8_t>> hypotheses,
                             std::span<const PhotoConsistency> moments, const DepthSelectionParams& terms);

// A range of inverse distances, in 1/m. Inverse distances are larger for near objects, so farthest < nearest.
struct DepthRange {
  double farthest = 0, nearest = 0;
  bool operator==(const DepthRange&) const = default;
};

// Changes the range of the map. Each node gets the level of the new range that is closest to its depth.
void set_range(const DepthRange& range, FocalMap& map);

// Finds the range of the scene's depths, with a histogram of the depths of the latest rounds. The levels of nodes
// without texture, of nodes that a single camera sees, and of nodes outside the array's coverage are random. Therefore
// only informed nodes (see DepthSelection) vote. A plain value without locks.
class DepthVotes {
 public:
  // `nearest` is the largest inverse distance of the histogram, in 1/m. `smallest` is the side, in nodes, of the
  // smallest plausible object at a distance of 1 m. Nearer objects appear larger.
  explicit DepthVotes(double nearest = 0, double smallest = 0) : nearest_(nearest), smallest_(smallest) {}
  // Adds the votes of a round, and reduces the weight of earlier rounds. `map` has the selected levels. In a search or
  // a sweep, a vote for a near depth counts only if the votes around the node agree.
  void add(const FocalMap& map, const DepthSelection& choice);
  void clear() { votes_.fill(0); }
  // Returns the range of depths without the nearest and the farthest kOutliers of the votes, and without near objects
  // that are too small. Such objects are often errors: beside the edges of a uniform object in front of a uniform wall,
  // the cameras agree best about a depth nearer than any object. Returns nothing while less than kFewVotes of the
  // visible nodes vote.
  std::optional<DepthRange> range() const;

  static constexpr double kOutliers = 0.04, kFewVotes = 0.01, kFading = 0.8;

 private:
  std::vector<uint8_t> consistent(const FocalMap& map, const std::vector<uint8_t>& informed) const;

  static constexpr int kBins = 1024;
  double nearest_, smallest_;
  std::array<double, kBins> votes_{};
  double seen_ = 0;    // number of votes if every visible node had voted
  double rounds_ = 0;  // number of votes of a node that voted in every round
};

}  // namespace lf
