// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/focus_control.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/median.h"
#include "focus/plane_map.h"

namespace lf {
namespace {

// A sweep is not helped by what was found before: patches of 36 pixels tell depths apart that 12 do not.
constexpr int kSweepRadius = 4;

// Rounds from a sweep on until what was found has settled.
constexpr unsigned kSettling = kSweepRounds + 4;

SurfaceChoice choice_of(const ViewRequest& request, std::span<const Moments> moments, int radius = 1) {
  const FocalMap& map = *request.view.focus.map;
  std::vector<std::vector<uint8_t>> levels;
  for (const Trial& trial : request.trials) levels.push_back(trial_levels(map, trial));
  return choose_surface(map, levels, moments, radius);
}

}  // namespace

std::shared_ptr<const FocalMap> FocusControl::first_map(const View& view, const Plane& from) const {
  const double focused = plane_inverse(view, from, {0, 0, 1});
  const double distance = focused > 0 ? 1 / focused : 1;
  const double farthest = 1 / (settings_.far > 0 ? settings_.far : kFarthest * distance);
  const double nearest = 1 / (settings_.near > 0 ? settings_.near : kNearest * distance);
  return std::make_shared<FocalMap>(plane_map(view, from, nearest > farthest ? nearest : 2 * farthest, farthest));
}

void FocusControl::judge(const SurfaceChoice& choice, const ViewRequest& request, FocalMap& map) {
  const std::vector<Trial>& trials = request.trials;
  if (settings_.mode != FocusMode::kAuto) return;
  const double enough = std::max(kWorthwhile, kWorthwhilePart * choice.residual);
  const bool gains = choice.gained >= enough, worthwhile = is_worthwhile(choice, enough);
  if (gains) state_.flat = false;
  // A plane that is in use gives way only to a better one.
  double least = choice.cost[0] + (state_.flat ? 0 : kFlatEnough);
  for (size_t t = 1; t < trials.size() && !gains; t++) {
    if (trials[t].kind != Trial::Kind::kPlane || !(choice.cost[t] <= least)) continue;
    state_.flat = true;
    flat_inverse_ = request.view.focus.map->inverse_of(trials[t].value);
    least = choice.cost[t];
  }
  if (state_.flat) std::ranges::fill(map.levels, map.level_of(flat_inverse_));
  if (worthwhile) {
    quiet_ = 0;
    state_.interval = 1;
  } else if (++quiet_ >= kQuietRounds) {
    state_.interval = std::min(2 * state_.interval, state_.flat ? kLongestFlatRest : kLongestRest);
  }
}

// Where there are edges every round gains something, as what was smoothed becomes sharp again. What counts is that it gets
// better, and at rest that it gains more than it did without.
bool FocusControl::is_worthwhile(const SurfaceChoice& choice, double enough) {
  const double before = std::exchange(gained_before_, choice.gained), gained = std::max(before, choice.gained);
  if (state_.flat && choice.gained >= enough) return true;
  if (state_.interval > 1) {
    if (gained < kMoreAtRest * usual_gain_ + enough) return false;
    least_reached_ = std::numeric_limits<double>::infinity();
    return true;
  }
  usual_gain_ = gained;
  const double reached = choice.cost[0] - choice.gained;
  const bool better = reached < least_reached_ - enough;
  if (better) least_reached_ = reached;
  return better;
}

// Whether the cameras disagree much more than they used to.
bool FocusControl::is_another_scene() {
  const double now = state_.deviation;
  if (settling_ > 0) {
    settling_--;
    return false;
  }
  if (!(usual_ > 0)) usual_ = now;
  if (now <= kOtherFactor * usual_ + kOtherMore) {
    constexpr double kSlowly = 0.05;
    usual_ = std::min(now, usual_ + kSlowly * (now - usual_));
    looks_ = 0;
    return false;
  }
  if (looks_ >= kMostLooks) {  // so be it
    usual_ = now;
    return false;
  }
  looks_++;
  state_.looks++;
  state_.flat = false;
  state_.interval = 1;
  quiet_ = round_ = 0;
  least_reached_ = std::numeric_limits<double>::infinity();
  settling_ = kSettling + static_cast<unsigned>(latest_.underway());
  return true;
}

void FocusControl::follow_range(bool another, FocalMap& map) {
  if (!is_automatic()) return;
  DepthRange range{map.farthest, map.nearest};
  if (another)
    range = {range.farthest / 2, 2 * range.nearest};
  else if (settling_ == 0)
    range = range_for(map);
  if (settings_.near > 0) range.nearest = map.nearest;
  if (settings_.far > 0) range.farthest = map.farthest;
  if (!(range.nearest > range.farthest) || (range == DepthRange{map.farthest, map.nearest})) return;
  range_ = range;
  set_range(range, map);
}

// What a surface is worth beside the planes that were tried.
void FocusControl::count_planes(const SurfaceChoice& choice, const std::vector<Trial>& trials) {
  double least = std::numeric_limits<double>::infinity();
  for (size_t t = 0; t < trials.size(); t++)
    if ((trials[t].kind == Trial::Kind::kPlane || state_.flat) && choice.cost[t] < least) least = choice.cost[t];
  plane_deviations_.push_back(least);
  if (plane_deviations_.size() > kSweepPlanes) plane_deviations_.erase(plane_deviations_.begin());
  const double best = *std::ranges::min_element(plane_deviations_);
  state_.bought = std::isfinite(best) ? best - choice.cost[0] : 0;
}

std::vector<Trial> FocusControl::next_trials(const FocalMap& map) {
  if (++skipped_ < state_.interval) return {};
  skipped_ = 0;
  std::vector<Trial> trials;
  const unsigned round = round_++;
  if (state_.flat) {
    // There are no edges to move: planes nearby, and planes all over.
    constexpr int16_t kNearby = 6;
    trials = trials_of_round(round % kSweepRounds);
    trials.push_back({Trial::Kind::kPlane, static_cast<int16_t>(std::clamp(
                                               map.levels.front() + (round % 2 == 0 ? kNearby : -kNearby / 2), 0, 255))});
  } else {
    trials = trials_of_round(round, is_automatic() ? levels_in_use(map) : LevelRange{});
    // Every third round asks whether a plane would do.
    if (settings_.mode == FocusMode::kAuto && round_ % 3 == 0)
      trials.back() = {Trial::Kind::kPlane, median(map.levels)};
  }
  state_.trials = static_cast<unsigned>(trials.size());
  return trials;
}

FocusControl::Plan FocusControl::next(const ViewRequest& request, std::span<const Moments> moments,
                                      const Plane& from) {
  Plan plan{.view = request.view, .trials = {}};
  const std::shared_ptr<const FocalMap>& map = request.view.focus.map;
  if (settings_.mode == FocusMode::kPlane) {
    plan.view.focus.map = nullptr;
    if (!map || moments.empty()) return plan;
    // The viewer asks where it would be in focus: see add_focus_sweep().
    auto found = std::make_shared<FocalMap>(*map);
    found->levels = choice_of(request, moments, kSweepRadius).levels;
    plan.view.focus.map = std::move(found);
    return plan;
  }
  if (!map) {
    plan.view.focus.map = first_map(request.view, from);
    // Those that left before anything came of the first one begin together.
    if (state_.rounds > 0 || latest_.underway() == 0) {
      const FocusControl fresh(settings_);
      *this = fresh;
      settling_ = kSettling;
    } else {
      settling_++;
    }
  } else if (!moments.empty()) {
    SurfaceChoice choice = choice_of(request, moments);
    auto better = std::make_shared<FocalMap>(*map);
    better->levels = std::move(choice.levels);
    state_.rounds++;
    state_.residual = choice.residual;
    state_.gained = choice.gained;
    if (range_) set_range(*range_, *better);
    latest_.merge(request, choice, *better);
    if (!choice.cost.empty() && std::isfinite(choice.cost[0])) {
      state_.deviation = choice.cost[0];
      count_planes(choice, request.trials);
      judge(choice, request, *better);
      follow_range(is_another_scene(), *better);
    }
    plan.view.focus.map = std::move(better);
  } else if (std::shared_ptr<const FocalMap> latest = latest_.seen_from(request.view)) {
    plan.view.focus.map = std::move(latest);
  }
  latest_.set(plan.view);
  const FocalMap& next = *plan.view.focus.map;
  state_.near = 1 / next.nearest;
  state_.far = 1 / next.farthest;
  plan.trials = next_trials(next);
  if (!plan.trials.empty()) latest_.leaves(plan.trials);
  return plan;
}

}  // namespace lf
