// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "focus/moments.h"
#include "focus/trial_levels.h"
#include "geometry/pose.h"

namespace lf {

// What trials say about the surface they were made of.
struct SurfaceChoice {
  std::vector<uint8_t> levels;  // levels of the better surface, one for each node
  double residual = 0;  // median deviation through the smoothed surface, of nodes with evidence and as three equal
                        // cameras would have it, levels of luma; NaN: nothing is seen
  double gained = 0;    // mean over the nodes of how much the choice lowers deviations
  double changed = 0;   // fraction of the nodes that left the smoothed surface
  std::vector<uint8_t> chosen;    // trial of each node; 0: the smoothed surface
  std::vector<float> least;       // deviation through the chosen trial; infinity: not seen
  std::vector<float> lead;        // for each node the lead of the smoothed surface
  std::vector<uint8_t> informed;  // whether trials differ by so much that a node's choice tells where things are
  // For each trial the mean deviation over the nodes that all compared trials see. NaN: the trial sees too few of the
  // surface's nodes to be compared, or there are no such nodes.
  std::vector<double> cost;
  std::vector<double> energy;  // for each trial the mean squared deviation over these nodes, as in a picture's error
  double least_energy = 0;     // mean squared deviation of the choice, over the same nodes
};

// What can be told from trials besides their moments.
struct ChoiceTerms {
  std::span<const float> evidence;  // evidence of each node: see FocusArray
  int radius = 1;                   // nodes around that a deviation is averaged over
  double levels_a_pixel = 8;        // levels for a pixel of disparity between neighbouring cameras
  uint32_t jumps = 0;               // trials that have nothing to do with the surface, a bit for each: see kJump
};

// The level, for each node, of the trial through which the cameras agree best: where the deviation, averaged over some
// nodes around, is smallest, and the neighbours' levels are not far away. The smoothed surface (trials[0]) has a lead,
// so that what nothing tells apart becomes smooth: kLead of the median deviation, and kNoise for what rounded sums
// alone make of cameras that agree. A node that is apart from its neighbours by a pixel or more costs kSmooth of that
// median, and kSmoothNoise. Nodes with less than kLittleEvidence take what their neighbours have. Nodes that no trial
// sees keep their level; a trial that fewer cameras see than another does not compete there. `trials`: levels of each;
// planes of a sweep (kSweep trials and more) ascend from the third on.
inline constexpr double kLead = 0.06;
inline constexpr float kNoise = 0.25f, kSmoothNoise = 0.1f;  // levels of luma
inline constexpr double kSmooth = 0.4;
inline constexpr float kLittleEvidence = 0.25f;
// A node is informed whose deviation, with kTold levels of luma more, is less than kTelling of what a wrong depth has,
// and in a sweep less than kUnique of every plane's that is not beside the best: chance finds one among many that fits.
inline constexpr float kTold = 0.5f, kTelling = 0.3f, kUnique = 0.6f, kToldEvidence = 0.35f;
inline constexpr size_t kSweep = 7;
// A jump is taken where its deviation is less than 1 / kJump of the others': of many planes that are tried, one after
// the other, some fit by chance, and what is right never has another turn.
inline constexpr float kJump = 2;
SurfaceChoice choose_surface(const FocalMap& surface, std::span<const std::vector<uint8_t>> trials,
                             std::span<const Moments> moments, const ChoiceTerms& terms);

// Inverse distances, 1/m, farthest < nearest.
struct DepthRange {
  double farthest = 0, nearest = 0;
  bool operator==(const DepthRange&) const = default;
};

// Gives the map another range: each node gets the level nearest to where it was.
void set_range(const DepthRange& range, FocalMap& map);

// Counts at which depths a scene is, by the nodes that could tell in the latest rounds of trials: others, which see one
// camera alone, or no texture, or lie outside of what the array covers, are where chance put them and have no say. A
// plain value.
class DepthVotes {
 public:
  // Depths up to `nearest`, 1/m, are told apart. `smallest`: nodes along a side of the smallest thing that is believed
  // to be 1 m away; what is nearer is seen larger.
  explicit DepthVotes(double nearest = 0, double smallest = 0) : nearest_(nearest), smallest_(smallest) {}
  // `map`: the choice. Earlier rounds fade. In a search or a sweep a vote for something near counts only where the
  // votes around it agree.
  void add(const FocalMap& map, const SurfaceChoice& choice);
  void clear() { votes_.fill(0); }
  // The depths of all but kOutliers of the votes to each side, and without votes for something near that is too small:
  // where a plain thing stands before a plain wall, the cameras agree best beside its edges on a depth so near that
  // none of them sees it. Nothing while fewer than kFewVotes of the nodes that the cameras see could tell.
  std::optional<DepthRange> range() const;

  static constexpr double kOutliers = 0.04, kFewVotes = 0.01, kFading = 0.8;

 private:
  std::vector<uint8_t> consistent(const FocalMap& map, const std::vector<uint8_t>& informed) const;

  static constexpr int kBins = 1024;
  double nearest_, smallest_;
  std::array<double, kBins> votes_{};
  double seen_ = 0;    // votes if every node that the cameras see had voted
  double rounds_ = 0;  // votes of a single node that voted in every round
};

}  // namespace lf
