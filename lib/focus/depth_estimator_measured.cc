// SPDX-License-Identifier: LGPL-2.1-or-later
// The stage of DepthEstimator in which the cameras measure the surface by their own depth maps.
#include <algorithm>
#include <cstdlib>
#include <utility>

#include "focus/depth_estimator.h"

namespace lf {

namespace {

// The range of the scene contains the measured levels between these parts of all nodes.
constexpr double kLowest = 0.005, kHighest = 0.995;
// The range of the map exceeds the range of the scene by this factor on both sides.
constexpr double kBeyond = 1.2;

struct MeasuredLevels {
  std::vector<uint8_t> levels;  // of each node; 0 where nothing was measured
  std::vector<uint8_t> sorted;  // of the nodes with a measurement
};

MeasuredLevels levels_of(const PhotoConsistency& measured) {
  MeasuredLevels out{std::vector<uint8_t>(measured.weight.size()), {}};
  for (size_t i = 0; i < measured.weight.size(); i++) {
    if (measured.weight[i] == 0) continue;
    const int level = (256 * measured.luma[i] + measured.weight[i] / 2) / measured.weight[i];
    out.levels[i] = static_cast<uint8_t>(std::min(level, 255));
    out.sorted.push_back(out.levels[i]);
  }
  std::ranges::sort(out.sorted);
  return out;
}

// Gives each node without a measurement the farther level of the nearest measured nodes to its left and right. A level
// that is too far may be outside the images of all cameras, and the picture black there. Rows without measurements do
// not change.
void fill_holes(const PhotoConsistency& measured, FocalMap& map) {
  constexpr int kNone = 256;
  std::vector<int> left(static_cast<size_t>(map.columns));
  for (int j = 0; j < map.rows; j++) {
    const size_t row = static_cast<size_t>(j) * map.columns;
    int known = kNone;
    for (int i = 0; i < map.columns; i++) left[i] = known = measured.weight[row + i] > 0 ? map.levels[row + i] : known;
    known = kNone;
    for (int i = map.columns - 1; i >= 0; i--) {
      if (measured.weight[row + i] > 0) known = map.levels[row + i];
      if (const int level = std::min(left[i], known); measured.weight[row + i] == 0 && level != kNone)
        map.levels[row + i] = static_cast<uint8_t>(level);
    }
  }
}

}  // namespace

// Takes the surface that the cameras have measured: `map`, with the range of the request, gets its levels. Returns
// false if the cameras have not measured enough, or the search is better for this scene.
bool DepthEstimator::take_measured(const PhotoConsistency& measured, const ViewRequest& request, FocalMap& map) {
  constexpr double kEnough = 0.1;  // least part of the nodes
  const MeasuredLevels found = levels_of(measured);
  if (static_cast<double>(found.sorted.size()) < kEnough * static_cast<double>(found.levels.size())) {
    if (stage_ == Stage::kMeasured && ++lost_ > kMaxLost) end_measured(true, map);
    return false;
  }
  const auto level_at = [&](double part) {
    return found.sorted[static_cast<size_t>(part * static_cast<double>(found.sorted.size() - 1))];
  };
  const uint8_t first = level_at(kLowest), last = level_at(kHighest);
  DepthRange scene{map.inverse_of(first), map.inverse_of(last)};
  if (disparity_ * (scene.nearest - scene.farthest) < kWideDisparity) {
    wants_measured_ = false;
    if (stage_ == Stage::kMeasured) end_measured(false, map);
    return false;
  }
  if (stage_ != Stage::kMeasured) {
    stage_ = Stage::kMeasured;
    wants_measured_ = false;
    worse_ = 0;
    sweeps_.clear();
    others_.clear();
    doubt_ = 0;
    was_better_ = state_.flat = false;
    state_.interval = 1;
    rounds_without_gain_ = 0;
  }
  lost_ = 0;
  map.levels = found.levels;
  for (size_t i = 0; i < map.levels.size(); i++)
    if (measured.weight[i] == 0) map.levels[i] = first;
  fill_holes(measured, map);
  rest_if_unchanged(request, map);
  // Levels at the ends of the map's range may be farther or nearer.
  constexpr int kAtTheEnd = 2;
  if (last >= 255 - kAtTheEnd) scene.nearest = 2 * map.nearest;
  if (first <= kAtTheEnd) scene.farthest = map.farthest / 2;
  const DepthRange right{scene.farthest / kBeyond, std::min(kBeyond * scene.nearest, reach_)};
  const double too_wide = (map.nearest - map.farthest) / (right.nearest - right.farthest);
  if (is_automatic() && (too_wide > kBeyond || last >= 255 - kAtTheEnd || (first <= kAtTheEnd && map.farthest > 0)))
    use_range(right, map);
  return true;
}

// Asks for the surface less often while it stays the same.
void DepthEstimator::rest_if_unchanged(const ViewRequest& request, const FocalMap& map) {
  constexpr int kSame = 6;         // levels
  constexpr double kPart = 0.005;  // of the nodes
  const std::shared_ptr<const FocalMap> before = latest_.seen_from(request.view);
  size_t changed = map.levels.size();
  if (before && before->levels.size() == changed && before->nearest == map.nearest &&
      before->farthest == map.farthest) {
    changed = 0;
    for (size_t i = 0; i < map.levels.size(); i++) changed += std::abs(map.levels[i] - before->levels[i]) > kSame;
  }
  if (static_cast<double>(changed) > kPart * static_cast<double>(map.levels.size())) {
    rounds_without_gain_ = 0;
    state_.interval = 1;
  } else if (++rounds_without_gain_ >= kQuietRounds) {
    state_.interval = std::min(2 * state_.interval, kLongestRest);
  }
}

// Returns to the search. If `requeue` is true, the cameras will be asked again after the search, because they have
// stopped measuring. Otherwise their surface was wrong or shallow, and they are not asked until the scene changes.
void DepthEstimator::end_measured(bool requeue, FocalMap& map) {
  state_.interval = 1;
  rounds_without_gain_ = 0;
  can_measure_ = requeue;
  search_around(map);
}

}  // namespace lf
