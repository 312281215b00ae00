// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/focus_control.h"

#include <algorithm>
#include <cmath>

#include "base/median.h"
#include "focus/plane_map.h"

namespace lf {
namespace {

// A sweep is not helped by what was found before: patches of 36 pixels tell depths apart that 12 do not.
constexpr int kSweepRadius = 4;

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

void FocusControl::judge(const SurfaceChoice& choice, const std::vector<Trial>& trials, FocalMap& map) {
  if (settings_.mode != FocusMode::kAuto) return;
  const bool worthwhile = choice.gained >= std::max(kWorthwhile, kWorthwhilePart * choice.residual);
  if (worthwhile) state_.flat = false;
  for (size_t t = 1; t < trials.size() && !worthwhile; t++) {
    if (trials[t].kind != Trial::Kind::kPlane || !(choice.cost[t] <= choice.cost[0] + kFlatEnough)) continue;
    state_.flat = true;
    flat_level_ = static_cast<uint8_t>(trials[t].value);
  }
  if (state_.flat) std::ranges::fill(map.levels, flat_level_);
  if (worthwhile) {
    quiet_ = 0;
    state_.interval = 1;
  } else if (++quiet_ >= kSweepPlanes) {
    state_.interval = std::min(2 * state_.interval, state_.flat ? kLongestFlatRest : kLongestRest);
  }
}

std::vector<Trial> FocusControl::next_trials(const FocalMap& map) {
  if (++skipped_ < state_.interval) return {};
  skipped_ = 0;
  std::vector<Trial> trials = trials_of_round(round_++);
  // Every third round asks whether a plane would do.
  if (settings_.mode == FocusMode::kAuto && round_ % 3 == 0)
    trials.push_back({Trial::Kind::kPlane, median(map.levels)});
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
    state_ = {};
    quiet_ = 0;
    skipped_ = 0;
  } else if (!moments.empty()) {
    SurfaceChoice choice = choice_of(request, moments);
    auto better = std::make_shared<FocalMap>(*map);
    better->levels = std::move(choice.levels);
    state_.rounds++;
    state_.residual = choice.residual;
    state_.gained = choice.gained;
    judge(choice, request.trials, *better);
    plan.view.focus.map = std::move(better);
  }
  plan.trials = next_trials(*plan.view.focus.map);
  return plan;
}

}  // namespace lf
