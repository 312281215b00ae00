// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <optional>

#include "focus/surface_choice.h"
#include "focus/trial_levels.h"
#include "geometry/focal_surface.h"

namespace lf {

// Inverse distances, 1/m, farthest < nearest.
struct DepthRange {
  double farthest = 0, nearest = 0;
  bool operator==(const DepthRange&) const = default;
};

// The same surface in another range: each node at the level nearest to where it was.
void set_range(const DepthRange& range, FocalMap& map);

// At which depths a scene is, by the nodes that could tell in the latest rounds of trials: others, which see one camera
// alone, or no texture, or lie outside of what the array covers, are where chance put them and have no say. A plain
// value.
class DepthVotes {
 public:
  // Depths up to `nearest`, 1/m, are told apart. `smallest`: nodes along a side of the smallest thing that is believed
  // to be 1 m away; what is nearer is seen larger.
  explicit DepthVotes(double nearest = 0, double smallest = 0) : nearest_(nearest), smallest_(smallest) {}
  // `map`: the choice. Earlier rounds fade.
  void add(const FocalMap& map, const SurfaceChoice& choice);
  void clear() { votes_.fill(0); }
  // Of all but kOutliers of the votes to each side, and of those for something near that is too small to be there:
  // where a plain thing stands before a plain wall, the cameras agree best beside its edges on a depth so near that
  // none of them sees it. Nothing while fewer than kFewVotes of the latest nodes could tell.
  std::optional<DepthRange> range() const;

  static constexpr double kOutliers = 0.04, kFewVotes = 0.01, kFading = 0.8;

 private:
  static constexpr int kBins = 1024;
  double nearest_, smallest_;
  std::array<double, kBins> votes_{};
  double nodes_ = 0;   // that could have voted
  double of_map_ = 1;  // nodes of the latest round
};

}  // namespace lf
