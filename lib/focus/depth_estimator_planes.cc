// SPDX-License-Identifier: LGPL-2.1-or-later
// Depth hypotheses of DepthEstimator: all depths first, then depths around the scene.
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "base/maths.h"
#include "focus/depth_estimator.h"
#include "focus/hypothesis_levels.h"

namespace lf {
namespace {

// planes in each request of a sweep, besides the surface and the viewer's plane
constexpr size_t kPlanesOfSweep = kMaxHypotheses - 2;

// Distance between the planes of a search: kSearchStep pixels of disparity, or the fraction kSearchPart of the
// disparity if this is more. Hypotheses average over 4 x 4 pixels, so nothing is missed between planes. Near objects
// appear larger, so near planes can be farther apart.
constexpr double kSearchStep = 2, kSearchPart = 0.13;
constexpr double kSweepStep = 1.5;  // the same for a sweep
constexpr unsigned kMaxSweeps = 4;

// Smallest useful difference between two levels of a focal map.
constexpr double kFinestLevel = 1. / 32;  // pixels of disparity

// The depth range of maps exceeds the range of the scene by this factor on both sides, to notice approaching objects.
constexpr double kBeyond = 1.5;
constexpr double kMuchOff = 2;  // largest ratio of the range to its ideal size

// Size of the smallest object that may be nearer than everything else, in camera spacings.
constexpr double kSmallest = 1;

std::deque<std::vector<DepthHypothesis>> requests_of(const std::vector<int16_t>& levels) {
  const size_t requests = (levels.size() + kPlanesOfSweep - 1) / kPlanesOfSweep;
  std::deque<std::vector<DepthHypothesis>> out(
      requests, {{DepthHypothesis::Kind::kBlurred, 0}, {DepthHypothesis::Kind::kFocused, 0}});
  for (size_t i = 0; i < levels.size(); i++) out[i % requests].push_back({DepthHypothesis::Kind::kPlane, levels[i]});
  return out;
}

// Returns the distance between the nodes of the map, in pixels of the view. If the view enlarges the cameras' pixels,
// the distance grows up to kFinestNodes of these pixels, because the cameras cannot resolve more.
int step_for(const View& view, const FocusArray& array) {
  constexpr double kFinestNodes = 2;
  int step = FocalMap::kMinStep;
  if (!(array.focal() > 0)) return step;
  while (2 * step <= FocalMap::kMaxStep / 2 && 2 * step * array.focal() <= kFinestNodes * view.lens.fx()) step *= 2;
  return step;
}

// Returns true if depth maps of the cameras may give better pictures than the search: the scene has a wide disparity,
// or the search has found no depths. `disparity` is in pixels per 1/m.
bool may_need_depth_maps(const std::optional<DepthRange>& scene, double disparity) {
  return !scene || disparity * (scene->nearest - scene->farthest) >= kWideDisparity;
}

constexpr unsigned kPlaneEvery = 4;  // refinement rounds from one that tries the viewer's plane to the next

}  // namespace

void DepthEstimator::begin(const ViewRequest& request, const FocusArray& array, View& view) {
  DepthEstimator fresh(settings_);
  fresh.load_interval_ = load_interval_;
  *this = std::move(fresh);
  begun_ = true;
  reference_pose_ = request.view.pose;
  const double focused = plane_inverse(request.view, array.from(), {0, 0, 1});
  const double distance = focused > 0 ? 1 / focused : 1;
  disparity_ = array.disparity();
  max_inverse_distance_ = array.nearest() > 0 ? array.nearest() : 1 / (kNearest * distance);
  reach_ = reach_from(request.view, array);
  DepthRange range{settings_.far > 0 ? 1 / settings_.far : 0, settings_.near > 0 ? 1 / settings_.near : reach_};
  if (!(range.nearest > range.farthest)) range.nearest = 2 * range.farthest;
  max_inverse_distance_ = std::max(max_inverse_distance_, range.nearest);
  const auto map = std::make_shared<FocalMap>(
      plane_map(request.view, array.from(), range.nearest, range.farthest, step_for(request.view, array)));
  votes_ = DepthVotes(max_inverse_distance_, kSmallest * array.spacing() * request.view.lens.fx() / map->step);
  view.focus.map = map;
  // Depths count as different if the disparity between them is more than the distance between nodes.
  others_ =
      DepthAmbiguity(array.edge() > 0 ? map->step / (array.edge() * view.lens.fx()) : range.nearest / kPlanesOfSweep);
  settling_rounds_ = kSettling;
  if (is_automatic())
    search(*map);
  else
    sweep(*map);
}

// Returns the largest inverse distance to search from this viewpoint. Objects just in front of the viewpoint appear so
// large that the cameras agree about them at any depth, so the search stops before.
double DepthEstimator::reach_from(const View& view, const FocusArray& array) const {
  constexpr double kBeforeEye = 3;  // multiples of the distance from the viewpoint to the array
  const double eye = array.from().signed_distance(view.pose.position);
  return eye > 0 && !(settings_.near > 0) ? std::min(max_inverse_distance_, 1 / (kBeforeEye * eye))
                                          : max_inverse_distance_;
}

void DepthEstimator::search(const FocalMap& map) {
  stage_ = Stage::kSearch;
  lost_ = 0;
  votes_.clear();
  others_.clear();
  const double pixels = disparity_ > 0 ? disparity_ : kMaxSweeps * kPlanesOfSweep * kSearchStep / reach_;
  std::vector<int16_t> levels;
  for (double at = map.farthest * pixels; at <= map.nearest * pixels; at += std::max(kSearchStep, kSearchPart * at))
    levels.push_back(map.level_of(at / pixels));
  if (levels.size() > kMaxSweeps * kPlanesOfSweep) levels.resize(kMaxSweeps * kPlanesOfSweep);
  sweeps_ = requests_of(levels);
  unanswered_ = static_cast<int>(sweeps_.size());
}

void DepthEstimator::search_around(FocalMap& map) {
  use_range({map.farthest / 2, 2 * map.nearest}, map);
  search(map);
}

void DepthEstimator::end_search(const View& view, const FocusArray& array, FocalMap& map) {
  const std::optional<DepthRange> scene = votes_.range();
  const bool found = scene.has_value();
  wants_measured_ = can_measure_ && may_need_depth_maps(scene, disparity_);
  requests_since_search_ = measured_answers_ = 0;
  // A surface that is shown stays visible during another search.
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

void DepthEstimator::sweep(const FocalMap& map) {
  // Planes of a search that are far outside the scene fit by chance at some nodes, and are discarded. Planes near the
  // scene are kept, because the true depth of repeated structures such as bars may be just outside the range of their
  // false match.
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
    // Objects between two planes of a search get no votes, so the scene may extend half a step beyond the planes with
    // votes. Votes are not exact, either.
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

// Returns the range of the scene's levels, extended by a tenth on both sides.
LevelRange DepthEstimator::scene_levels(const FocalMap& map) const {
  constexpr int kMinMore = 6;
  const std::optional<DepthRange> scene = votes_.range();
  if (!scene) return {};
  const int first = map.level_of(scene->farthest), last = map.level_of(scene->nearest);
  const int more = std::max((last - first) / 10, kMinMore);
  return {std::max(first - more, 0), std::min(last + more, 255)};
}

void DepthEstimator::use_range(DepthRange range, FocalMap& map) {
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

void DepthEstimator::follow_range(FocalMap& map) {
  const std::optional<DepthRange> scene = votes_.range();
  if (!is_automatic() || !scene) return;
  const DepthRange right{scene->farthest / kBeyond, kBeyond * scene->nearest};
  constexpr double kAtTheEnd = 8 / FocalMap::kLevels;
  const double end = kAtTheEnd * (map.nearest - map.farthest);
  const bool at_near_end = scene->nearest > map.nearest - end && map.nearest < reach_;
  // Objects at the near end of the range may be approaching. A single plane can fit by chance, so a search must confirm
  // such objects.
  if (at_near_end && stage_ == Stage::kBetter) {
    if (rounds_until_recheck_ > 0) {
      rounds_until_recheck_--;
    } else {
      rounds_until_recheck_ = recheck_interval_;
      recheck_interval_ = std::min(2 * recheck_interval_, kMaxBackoff);
      return search_around(map);
    }
  }
  const bool at_far_end = scene->farthest < map.farthest + end && map.farthest > 0;
  const bool too_wide = map.nearest - map.farthest > kMuchOff * (right.nearest - right.farthest);
  const bool too_near = map.nearest > (1 + 1e-9) * reach_;
  if (at_far_end || too_wide || too_near || stage_ == Stage::kSearch) use_range(right, map);
}

// Ends a search without a result: shows the viewer's plane and pauses, because no depths can be distinguished. The
// pause is shorter after a search with missing answers, for example from an overloaded machine.
void DepthEstimator::give_up() {
  stage_ = Stage::kNothing;
  state_.on_plane = true;
  waited_ = 0;
  backoff_ = std::min(2 * backoff_, unanswered_ > 0 ? kBusyBackoff : kMaxBackoff);
}

// Repeats the hypotheses of a request that was lost or that a busy node did not answer in time. A search with a missing
// answer may find nothing, and the next search may be hundreds of pictures away.
void DepthEstimator::requeue(const std::vector<DepthHypothesis>& lost) {
  if (lost.size() < kSweep || (stage_ != Stage::kSearch && stage_ != Stage::kSweep) || lost_ >= kMaxLost) return;
  lost_++;
  sweeps_.push_back(lost);
}

std::vector<DepthHypothesis> DepthEstimator::next_hypotheses(const FocalMap& map) {
  // Every picture waits for the end of a search or sweep, so only refinement is less frequent to save time.
  const unsigned least = sweeps_.empty() ? min_interval_ : 1;
  if (++requests_since_hypotheses_ < std::max(load_interval_, least)) {
    const bool may_ask = requests_since_hypotheses_ >= load_interval_ && stage_ != Stage::kSearch;
    return may_ask ? with_measured({}) : std::vector<DepthHypothesis>();
  }
  const unsigned passed =
      std::exchange(requests_since_hypotheses_, 0);  // requests since the last one that could have had hypotheses
  if (!sweeps_.empty()) {
    std::vector<DepthHypothesis> hypotheses = std::move(sweeps_.front());
    sweeps_.pop_front();
    state_.hypotheses = static_cast<unsigned>(hypotheses.size());
    return hypotheses;
  }
  if (stage_ == Stage::kNothing) {
    waited_ += passed;
    if (waited_ < (moved_ ? kMovingBackoff : backoff_)) return with_measured({});
    moved_ = false;
    search(map);
    return next_hypotheses(map);
  }
  if (stage_ == Stage::kSearch || stage_ == Stage::kSweep) {  // the answers decide the next stage
    if (stage_ == Stage::kSearch || latest_.underway() > 0) return {};
    stage_ = Stage::kBetter;
    if (!is_automatic()) {  // there was no search before the sweep
      wants_measured_ = can_measure_ && may_need_depth_maps(votes_.range(), disparity_);
      requests_since_search_ = measured_answers_ = 0;
    }
  }
  constexpr unsigned kMovingFlatRest = 4;
  const unsigned moving_rest = state_.flat ? std::min(state_.interval, kMovingFlatRest) : 1;
  skipped_ += passed;
  if (skipped_ < (moved_ ? moving_rest : state_.interval)) return with_measured({});
  moved_ = false;
  skipped_ = 0;
  std::vector<DepthHypothesis> hypotheses;
  const unsigned round = round_++;
  if (stage_ == Stage::kMeasured)
    return {{DepthHypothesis::Kind::kBlurred, 0},
            {DepthHypothesis::Kind::kFocused, 0},
            {DepthHypothesis::Kind::kMeasured, 0}};
  if (state_.flat) {
    // A flat scene has no depth edges. Instead of moving edges, test two planes next to the current plane, besides the
    // plane of the round.
    constexpr int kNearby[] = {8, 4, 2, 1};  // levels, in turn
    hypotheses = hypotheses_of_round(round);
    hypotheses.erase(hypotheses.begin() + 1, hypotheses.end() - 1);
    for (const int by : {-kNearby[round % 4], kNearby[round % 4]})
      hypotheses.push_back(
          {DepthHypothesis::Kind::kPlane, static_cast<int16_t>(std::clamp(map.levels.front() + by, 0, 255))});
  } else {
    hypotheses = hypotheses_of_round(round, is_automatic() ? scene_levels(map) : LevelRange{});
    if (settings_.mode == FocusMode::kAuto && round_ % 3 == 0)
      hypotheses.back() = {DepthHypothesis::Kind::kPlane, median(map.levels)};
  }
  // If a plane is shown instead of the viewer's, kFocused would test this plane again.
  const bool is_replaced = state_.flat && !state_.on_plane, is_due = round % kPlaneEvery == 0;
  if ((is_due || (state_.on_plane && was_better_)) && !is_replaced)
    hypotheses[state_.flat ? 1 : hypotheses.size() - 1] = {DepthHypothesis::Kind::kFocused, 0};
  state_.hypotheses = static_cast<unsigned>(hypotheses.size());
  return with_measured(std::move(hypotheses));
}

// Adds the hypothesis kMeasured to a request if the measured surface is due.
std::vector<DepthHypothesis> DepthEstimator::with_measured(std::vector<DepthHypothesis> hypotheses) {
  const unsigned every = measured_answers_ < kOftenAsked ? kMeasuredEvery : kMeasuredSeldom;
  if (!wants_measured_ || requests_since_search_++ % every != 0) return hypotheses;
  if (hypotheses.empty()) hypotheses.push_back({DepthHypothesis::Kind::kBlurred, 0});
  hypotheses.push_back({DepthHypothesis::Kind::kMeasured, 0});
  return hypotheses;
}

}  // namespace lf
