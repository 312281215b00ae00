// SPDX-License-Identifier: LGPL-2.1-or-later
// What FocusControl has the cameras try: all depths, then those around what was found.
#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "base/maths.h"
#include "focus/focus_control.h"
#include "focus/trial_levels.h"

namespace lf {
namespace {

constexpr size_t kPlanesOfSweep = kMaxTrials - 2;  // of a sweep's request, beside the surface and the viewer's plane

// Planes of a search: as far apart as trials, which average over 4 x 4 pixels, can miss nothing between; for what is
// near, and so seen large, farther apart.
constexpr double kSearchStep = 2, kSearchPart = 0.13;  // pixels of disparity; of it
constexpr double kSweepStep = 1.5;                     // the same of a sweep where the scene is
constexpr unsigned kMostSweeps = 4;

// 255 levels need not tell less than this apart.
constexpr double kFinestLevel = 1. / 32;  // pixels of disparity

// What is looked at lies around the scene: so much farther and nearer, to notice what comes from there.
constexpr double kBeyond = 1.5;
constexpr double kMuchOff = 2;  // times the range that it should be

// Metres between neighbouring cameras: nothing smaller is believed to be nearer than all else.
constexpr double kSmallest = 1;

// Planes at these levels in as many requests as they need, each with planes from all over.
std::deque<std::vector<Trial>> requests_of(const std::vector<int16_t>& levels) {
  const size_t requests = (levels.size() + kPlanesOfSweep - 1) / kPlanesOfSweep;
  std::deque<std::vector<Trial>> out(requests, {{Trial::Kind::kBlurred, 0}, {Trial::Kind::kFocused, 0}});
  for (size_t i = 0; i < levels.size(); i++) out[i % requests].push_back({Trial::Kind::kPlane, levels[i]});
  return out;
}

// Pixels from node to node: where the view shows the cameras' pixels enlarged, nodes are not closer than kFinestNodes
// of these.
int step_for(const View& view, const FocusArray& array) {
  constexpr double kFinestNodes = 2;
  int step = FocalMap::kFinestStep;
  if (!(array.focal() > 0)) return step;
  while (2 * step <= FocalMap::kMaxStep / 2 && 2 * step * array.focal() <= kFinestNodes * view.lens.fx()) step *= 2;
  return step;
}

constexpr unsigned kPlaneEvery = 4;  // rounds of bettering from one that tries the viewer's plane to the next

}  // namespace

void FocusControl::begin(const ViewRequest& request, const FocusArray& array, View& view) {
  FocusControl fresh(settings_);
  fresh.load_ = load_;
  *this = std::move(fresh);
  begun_ = true;
  tried_from_ = request.view.pose;
  const double focused = plane_inverse(request.view, array.from(), {0, 0, 1});
  const double distance = focused > 0 ? 1 / focused : 1;
  disparity_ = array.disparity();
  most_reach_ = array.nearest() > 0 ? array.nearest() : 1 / (kNearest * distance);
  reach_ = reach_from(request.view, array);
  DepthRange range{settings_.far > 0 ? 1 / settings_.far : 0, settings_.near > 0 ? 1 / settings_.near : reach_};
  if (!(range.nearest > range.farthest)) range.nearest = 2 * range.farthest;
  most_reach_ = std::max(most_reach_, range.nearest);
  const auto map = std::make_shared<FocalMap>(
      plane_map(request.view, array.from(), range.nearest, range.farthest, step_for(request.view, array)));
  votes_ = DepthVotes(most_reach_, kSmallest * array.spacing() * request.view.lens.fx() / map->step);
  view.focus.map = map;
  // What is in focus moves by a node's side from one to the next.
  others_ =
      OtherDepths(array.edge() > 0 ? map->step / (array.edge() * view.lens.fx()) : range.nearest / kPlanesOfSweep);
  settling_ = kSettling;
  if (is_automatic())
    search(*map);
  else
    sweep(*map);
}

// What is just before the eye is seen so large that cameras agree on it wherever it is.
double FocusControl::reach_from(const View& view, const FocusArray& array) const {
  constexpr double kBeforeEye = 3;  // times its distance before the array
  const double eye = array.from().signed_distance(view.pose.position);
  return eye > 0 && !(settings_.near > 0) ? std::min(most_reach_, 1 / (kBeforeEye * eye)) : most_reach_;
}

void FocusControl::search(const FocalMap& map) {
  stage_ = Stage::kSearch;
  lost_ = 0;
  votes_.clear();
  others_.clear();
  const double pixels = disparity_ > 0 ? disparity_ : kMostSweeps * kPlanesOfSweep * kSearchStep / reach_;
  std::vector<int16_t> levels;
  for (double at = map.farthest * pixels; at <= map.nearest * pixels; at += std::max(kSearchStep, kSearchPart * at))
    levels.push_back(map.level_of(at / pixels));
  if (levels.size() > kMostSweeps * kPlanesOfSweep) levels.resize(kMostSweeps * kPlanesOfSweep);
  sweeps_ = requests_of(levels);
  unanswered_ = static_cast<int>(sweeps_.size());
}

// Looks for all that is up to twice as near or as far as what is known.
void FocusControl::search_around(FocalMap& map) {
  use_range({map.farthest / 2, 2 * map.nearest}, map);
  search(map);
}

void FocusControl::end_search(const View& view, const FocusArray& array, FocalMap& map) {
  const bool found = votes_.range().has_value();
  // A surface that is shown stays while another one is looked for.
  if (found) {
    follow_range(map);
  } else if (state_.on_plane) {
    use_range({0, reach_}, map);
  }
  if (state_.on_plane) map = plane_map(view, array.from(), map.nearest, map.farthest);
  if (found)
    sweep(map);
  else if (state_.on_plane)
    give_up();
  else
    stage_ = Stage::kBetter;
}

void FocusControl::sweep(const FocalMap& map) {
  // Among the many planes of a search some that are far outside of the scene fit by chance. Bars, however, can be at
  // another depth than their false match.
  constexpr double kNearby = 2;
  if (stage_ == Stage::kSearch)
    others_.forget_beyond(map.farthest / kNearby, kNearby * map.nearest);
  else
    others_.clear();
  stage_ = Stage::kSweep;
  lost_ = 0;
  LevelRange scene = scene_levels(map);
  const double per_level = (map.nearest - map.farthest) / FocalMap::kLevels;
  if (const std::optional<DepthRange> known = votes_.range(); known && disparity_ > 0) {
    // What lies between two planes of a search has no votes: it may lie half-way beyond the scene,
    // and what votes is not exactly there.
    const double step = std::max(kSearchStep / disparity_, kSearchPart * known->nearest) * 0.75;
    scene.first = std::min<int>(scene.first, map.level_of(known->farthest - step));
    scene.last = std::max<int>(scene.last, map.level_of(known->nearest + step));
  }
  const double pixels = disparity_ > 0 ? (scene.last - scene.first) * per_level * disparity_ : 0;
  const auto count =
      static_cast<int>(std::clamp<double>(std::ceil(pixels / kSweepStep), kPlanesOfSweep, 2.0 * kPlanesOfSweep));
  std::vector<int16_t> levels;
  for (int k = 0; k < count; k++)
    levels.push_back(static_cast<int16_t>(scene.first + (scene.last - scene.first) * k / (count - 1)));
  sweeps_ = requests_of(levels);
}

// The levels that the scene is at, and a tenth more.
LevelRange FocusControl::scene_levels(const FocalMap& map) const {
  constexpr int kLeastMore = 6;
  const std::optional<DepthRange> scene = votes_.range();
  if (!scene) return {};
  const int first = map.level_of(scene->farthest), last = map.level_of(scene->nearest);
  const int more = std::max((last - first) / 10, kLeastMore);
  return {std::max(first - more, 0), std::min(last + more, 255)};
}

void FocusControl::use_range(DepthRange range, FocalMap& map) {
  if (settings_.near > 0) range.nearest = map.nearest;
  if (settings_.far > 0) range.farthest = map.farthest;
  range.nearest = std::min(range.nearest, reach_);
  if (disparity_ > 0) {
    const double least = FocalMap::kLevels * kFinestLevel / disparity_, more = least - (range.nearest - range.farthest);
    if (more > 0) range = {std::max(range.farthest - more / 2, 0.), range.nearest + more / 2};
    constexpr double kFar = 0.5;  // pixels from infinity
    if (range.farthest * disparity_ < kFar && !(settings_.far > 0)) range.farthest = 0;
  }
  if (!(range.nearest > range.farthest) || (range == DepthRange{map.farthest, map.nearest})) return;
  range_ = range;
  set_range(range, map);
}

// Only nodes that can tell have a say.
void FocusControl::follow_range(FocalMap& map) {
  const std::optional<DepthRange> scene = votes_.range();
  if (!is_automatic() || !scene) return;
  const DepthRange right{scene->farthest / kBeyond, kBeyond * scene->nearest};
  constexpr double kAtTheEnd = 8 / FocalMap::kLevels;
  const double end = kAtTheEnd * (map.nearest - map.farthest);
  const bool at_near_end = scene->nearest > map.nearest - end && map.nearest < reach_;
  // One plane among a few is taken by chance: what seems to come nearer has to be found by a search, too.
  if (at_near_end && stage_ == Stage::kBetter) {
    if (rounds_to_doubt_ > 0) {
      rounds_to_doubt_--;
    } else {
      rounds_to_doubt_ = doubts_;
      doubts_ = std::min(2 * doubts_, kMostPatience);
      return search_around(map);
    }
  }
  const bool at_far_end = scene->farthest < map.farthest + end && map.farthest > 0;
  const bool too_wide = map.nearest - map.farthest > kMuchOff * (right.nearest - right.farthest);
  const bool too_near = map.nearest > (1 + 1e-9) * reach_;
  if (at_far_end || too_wide || too_near || stage_ == Stage::kSearch) use_range(right, map);
}

// Nothing tells depths apart: the viewer's plane it is, until something has changed. Where part of the search was never
// answered, as by a machine that is too busy, that says less.
void FocusControl::give_up() {
  stage_ = Stage::kNothing;
  state_.on_plane = true;
  waited_ = 0;
  patience_ = std::min(2 * patience_, unanswered_ > 0 ? kBusyPatience : kMostPatience);
}

// What a busy node has not answered in time, or what never got there, is asked again: of a search that lacks an answer
// nothing may be found, and the next one may be hundreds of pictures away.
void FocusControl::ask_again(const std::vector<Trial>& lost) {
  if (lost.size() < kSweep || (stage_ != Stage::kSearch && stage_ != Stage::kSweep) || lost_ >= kMostLost) return;
  lost_++;
  sweeps_.push_back(lost);
}

std::vector<Trial> FocusControl::next_trials(const FocalMap& map) {
  if (++held_ < std::max(load_, spared_)) return {};
  const unsigned passed = std::exchange(held_, 0);  // requests since one that might have had trials
  if (!sweeps_.empty()) {
    std::vector<Trial> trials = std::move(sweeps_.front());
    sweeps_.pop_front();
    state_.trials = static_cast<unsigned>(trials.size());
    return trials;
  }
  if (stage_ == Stage::kNothing) {
    waited_ += passed;
    if (waited_ < (moved_ ? kMovingPatience : patience_)) return {};
    moved_ = false;
    search(map);
    return next_trials(map);
  }
  if (stage_ == Stage::kSearch || stage_ == Stage::kSweep) {  // what comes of it decides what comes next
    if (stage_ == Stage::kSearch || latest_.underway() > 0) return {};
    stage_ = Stage::kBetter;
  }
  constexpr unsigned kMovingFlatRest = 4;
  const unsigned moving_rest = state_.flat ? std::min(state_.interval, kMovingFlatRest) : 1;
  skipped_ += passed;
  if (skipped_ < (moved_ ? moving_rest : state_.interval)) return {};
  moved_ = false;
  skipped_ = 0;
  std::vector<Trial> trials;
  const unsigned round = round_++;
  if (state_.flat) {
    // There are no edges to move: planes nearby, and planes all over.
    constexpr int kNearby[] = {8, 4, 2, 1};  // levels, by turns
    trials = trials_of_round(round);
    trials.erase(trials.begin() + 1, trials.end() - 1);
    for (const int by : {-kNearby[round % 4], kNearby[round % 4]})
      trials.push_back({Trial::Kind::kPlane, static_cast<int16_t>(std::clamp(map.levels.front() + by, 0, 255))});
  } else {
    trials = trials_of_round(round, is_automatic() ? scene_levels(map) : LevelRange{});
    // Every third round asks whether a plane would do.
    if (settings_.mode == FocusMode::kAuto && round_ % 3 == 0)
      trials.back() = {Trial::Kind::kPlane, median(map.levels)};
  }
  // A plane that is all the scene needs stands where the viewer's would be tried.
  const bool is_replaced = state_.flat && !state_.on_plane, is_due = round % kPlaneEvery == 0;
  if ((is_due || (state_.on_plane && was_better_)) && !is_replaced)
    trials[state_.flat ? 1 : trials.size() - 1] = {Trial::Kind::kFocused, 0};
  state_.trials = static_cast<unsigned>(trials.size());
  return trials;
}

}  // namespace lf
