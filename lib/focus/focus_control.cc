// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/focus_control.h"

#include <algorithm>
#include <cmath>

namespace lf {
namespace {

uint8_t median_level(std::vector<uint8_t> levels) {
  const auto middle = levels.begin() + static_cast<ptrdiff_t>(levels.size() / 2);
  std::nth_element(levels.begin(), middle, levels.end());
  return *middle;
}

}  // namespace

std::shared_ptr<const FocalMap> FocusControl::first_map(const View& view, const Plane& from) const {
  auto map = std::make_shared<FocalMap>(FocalMap::for_view(view.width, view.height));
  map->from = from;
  const Plane& plane = view.focus.plane;

  // Where a line of sight meets the viewer's plane, as inverse distance; nothing if it does not.
  const Vec3 normal = glm::transpose(view.pose.rotation()) * plane.normal;
  const Vec3 counted = glm::transpose(view.pose.rotation()) * from.normal;
  const double offset = -plane.signed_distance(view.pose.position), eye = from.signed_distance(view.pose.position);
  const auto inverse = [&](const Vec3& d) {
    const double t = offset / glm::dot(normal, d);
    const double distance = eye + t * glm::dot(counted, d);
    return t > 0 && distance > 0 ? 1 / distance : 0;
  };
  const double focused = inverse({0, 0, 1});
  const double distance = focused > 0 ? 1 / focused : 1;
  map->nearest = 1 / (settings_.near > 0 ? settings_.near : kNearest * distance);
  map->farthest = 1 / (settings_.far > 0 ? settings_.far : kFarthest * distance);
  if (!(map->nearest > map->farthest)) map->nearest = 2 * map->farthest;
  map->levels.reserve(static_cast<size_t>(map->columns) * static_cast<size_t>(map->rows));
  for (int j = 0; j < map->rows; j++)
    for (int i = 0; i < map->columns; i++) {
      const double middle = (map->step - 1) / 2.0;
      const std::optional<Vec2> ray = view.lens.unproject({map->step * i + middle, map->step * j + middle});
      map->levels.push_back(map->level_of(ray ? inverse({*ray, 1}) : focused));
    }
  return map;
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
    trials.push_back({Trial::Kind::kPlane, median_level(map.levels)});
  return trials;
}

FocusControl::Plan FocusControl::next(const ViewRequest& request, std::span<const Moments> moments,
                                      const Plane& from) {
  Plan plan{.view = request.view, .trials = {}};
  if (settings_.mode == FocusMode::kPlane) {
    plan.view.focus.map = nullptr;
    return plan;
  }
  const std::shared_ptr<const FocalMap>& map = request.view.focus.map;
  if (!map) {
    plan.view.focus.map = first_map(request.view, from);
    state_ = {};
    quiet_ = 0;
    skipped_ = 0;
  } else if (!moments.empty()) {
    std::vector<std::vector<uint8_t>> levels;
    for (const Trial& trial : request.trials) levels.push_back(trial_levels(*map, trial));
    SurfaceChoice choice = choose_surface(*map, levels, moments);
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
