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

struct DepthSelection {
  std::vector<uint8_t> levels;  // levels of the better surface, one per node
  // Median deviation through the smoothed surface, over nodes with evidence, normalised to three equal cameras, levels
  // of luma. NaN: nothing is visible.
  double residual = 0;
  double gained = 0;              // mean reduction of the nodes' deviations
  double changed = 0;             // fraction of the nodes that left the smoothed surface
  std::vector<uint8_t> chosen;    // hypothesis selected at each node; 0: the smoothed surface
  std::vector<float> least;       // deviation through the selected hypothesis; infinity: not visible
  std::vector<float> lead;        // lead of the smoothed surface at each node
  std::vector<uint8_t> informed;  // 1: deviations of the hypotheses differ enough for a reliable depth
  // Mean deviation of each hypothesis over the nodes that all compared hypotheses see. NaN: the hypothesis sees too few
  // of the surface's nodes to be compared, or there are no such nodes.
  std::vector<double> cost;
  std::vector<double> energy;  // mean squared deviation of each hypothesis over these nodes
  double least_energy = 0;     // mean squared deviation of the selection over the same nodes
};

struct DepthSelectionParams {
  std::span<const float> evidence;  // evidence of each node: see FocusArray
  // 1: the node counts in DepthSelection::cost, energy and informed. Empty: all nodes do.
  std::span<const uint8_t> counted = {};
  int radius = 1;             // averaging radius of deviations, nodes
  double levels_a_pixel = 8;  // levels per pixel of disparity between neighbouring cameras
  uint32_t jumps = 0;         // bit mask of the hypotheses that are unrelated to the surface: see kJump
};

// Selects for each node the level of the hypothesis through which the cameras agree best: with the smallest deviation,
// averaged over nearby nodes, and with a level near the neighbours' levels.
//
// The smoothed surface (hypotheses[0]) has a lead, so that undecided nodes become smooth: kLead of the median
// deviation, plus kNoise, the deviation that rounded sums alone can cause. A node that differs from its neighbours by a
// pixel of disparity or more costs kSmooth of the median deviation, plus kSmoothNoise. Nodes with less evidence than
// kLittleEvidence take the levels of their neighbours. Nodes that no hypothesis sees keep their level. A hypothesis
// that fewer cameras see than another does not compete at that node. `hypotheses`: levels of each hypothesis; planes of
// a sweep (kSweep hypotheses or more) ascend from the third on.
inline constexpr double kLead = 0.06;
inline constexpr float kNoise = 0.25f, kSmoothNoise = 0.1f;  // levels of luma
inline constexpr double kSmooth = 0.4;
inline constexpr float kLittleEvidence = 0.25f;
// A node is informed if its deviation plus kLumaNoise (levels of luma) is less than kMaxDeviationRatio of the deviation
// at a wrong depth. In a sweep, it must also be less than kUnique of the deviation of every plane that is not adjacent
// to the best plane, because one of many planes can fit by chance.
inline constexpr float kLumaNoise = 0.5f, kMaxDeviationRatio = 0.3f, kUnique = 0.6f, kMinEvidence = 0.35f;
inline constexpr size_t kSweep = 7;
// For a jump, the deviation must be below 1 / kJump of the deviations of all other hypotheses, because some of many
// successive planes fit by chance, and the right level would not be tested again.
inline constexpr float kJump = 2;
DepthSelection select_depths(const FocalMap& surface, std::span<const std::vector<uint8_t>> hypotheses,
                             std::span<const PhotoConsistency> moments, const DepthSelectionParams& terms);

// Inverse distances, 1/m, farthest < nearest.
struct DepthRange {
  double farthest = 0, nearest = 0;
  bool operator==(const DepthRange&) const = default;
};

// Changes the range of the map; each node gets the nearest level.
void set_range(const DepthRange& range, FocalMap& map);

// Histogram of the scene's depths in the latest rounds. Only informed nodes vote: the levels of nodes that a single
// camera sees, without texture, or outside the array's coverage are random. A plain value.
class DepthVotes {
 public:
  // `nearest`: largest inverse distance, 1/m. `smallest`: side, in nodes, of the smallest plausible object at a
  // distance of 1 m; nearer objects are seen larger.
  explicit DepthVotes(double nearest = 0, double smallest = 0) : nearest_(nearest), smallest_(smallest) {}
  // Adds a round. `map`: the selected levels. Earlier rounds fade. In a search or a sweep, a vote for a near depth
  // counts only if the votes around the node agree.
  void add(const FocalMap& map, const DepthSelection& choice);
  void clear() { votes_.fill(0); }
  // Returns the depths without kOutliers of the votes on each side and without near objects that are too small. Reason:
  // beside the edges of a uniform object in front of a uniform wall, the cameras agree best on a depth too near for any
  // camera. Returns nothing while fewer than kFewVotes of the visible nodes vote.
  std::optional<DepthRange> range() const;

  static constexpr double kOutliers = 0.04, kFewVotes = 0.01, kFading = 0.8;

 private:
  std::vector<uint8_t> consistent(const FocalMap& map, const std::vector<uint8_t>& informed) const;

  static constexpr int kBins = 1024;
  double nearest_, smallest_;
  std::array<double, kBins> votes_{};
  double seen_ = 0;    // votes if every visible node had voted
  double rounds_ = 0;  // votes of a single node that voted in every round
};

}  // namespace lf
