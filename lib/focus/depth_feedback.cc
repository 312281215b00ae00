// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/depth_feedback.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "focus/autofocus.h"
#include "focus/depth_selection.h"
#include "focus/focus_array.h"
#include "focus/warp_depth_map.h"

namespace lf {
namespace {

constexpr uint32_t kPatience = 30;  // requests until a sweep counts as lost
constexpr int kMaxLost = 3;         // lost sweeps until a search ends
constexpr uint32_t kRest = 8;       // requests between sweeps in continuous autofocus
constexpr size_t kMaxSwept = 8;
constexpr size_t kMaxUnsent = 8;   // requests
constexpr double kSame = 0.02;     // part of a distance; smaller changes are ignored

}  // namespace

void DepthFeedback::announce(DepthEstimate news) {
  const std::lock_guard lock(mutex_);
  if (std::ranges::find(sweep_sequences_, news.sequence) != sweep_sequences_.end()) {
    if (search_ && search_->sequence == news.sequence) see_sweep(news);
  } else {
    take_hypotheses(news.plan);
    latest_estimate_ = std::move(news);
    if (follows_ && latest_estimate_->plan.view.focus.map)
      if (const auto distance = focus_distance_at(latest_estimate_->plan.view, pixel_of(latest_estimate_->plan.view)))
        find(*distance);
  }
  changed_.notify_all();
}

// Queues the hypotheses of a new estimate. Several estimates can arrive between two requests, because pictures come in
// bursts. The hypotheses of searches and sweeps are queued (up to kMaxUnsent requests), because all later steps depend
// on their results. Refinement hypotheses replace older refinement hypotheses.
void DepthFeedback::take_hypotheses(DepthEstimator::Plan& plan) {
  const auto is_of_other_levels = [](const FocalMap* a, const FocalMap* b) {
    return !a || !b || a->farthest != b->farthest || a->nearest != b->nearest || a->step != b->step ||
           !(a->from == b->from);
  };
  if (latest_estimate_ && is_of_other_levels(latest_estimate_->plan.view.focus.map.get(), plan.view.focus.map.get()))
    unsent_.clear();
  if (plan.hypotheses.empty()) return;
  std::erase_if(unsent_, [](const std::vector<DepthHypothesis>& hypotheses) { return hypotheses.size() < kSweep; });
  unsent_.push_back(std::exchange(plan.hypotheses, {}));
  if (unsent_.size() > kMaxUnsent) unsent_.pop_front();
}

Vec2 DepthFeedback::pixel_of(const View& view) const {
  return {place_.x * view.width - 0.5, place_.y * view.height - 0.5};
}

void DepthFeedback::find(double distance) {
  latest_ = distance;
  if (!follows_ || !(std::abs(distance / now_ - 1) < kSame)) found_ = distance;
}

void DepthFeedback::see_sweep(const DepthEstimate& news) {
  const View& view = news.plan.view;
  const Vec2 middle((view.width - 1) / 2.0, (view.height - 1) / 2.0);
  const std::optional<double> distance = view.focus.map ? focus_distance_at(view, middle) : std::nullopt;
  const std::optional<double> around = search_->found;
  search_->sequence.reset();
  if (distance && !around) {
    search_->found = distance;
  } else if (distance && (!follows_ || is_inside_sweep(*distance, *around))) {
    find(*distance);
    search_.reset();
  } else if (follows_ && around) {
    search_->found.reset();  // the place has left the swept range: start again
  } else {
    search_.reset();
  }
}

std::optional<double> DepthFeedback::focus_at(const Vec2& place, const View* seen) {
  const std::lock_guard lock(mutex_);
  place_ = place;
  latest_.reset();
  if (latest_estimate_ && latest_estimate_->plan.view.focus.map) {
    View view = seen ? *seen : latest_estimate_->plan.view;
    if (seen) view.focus.map = warp_depth_map(latest_estimate_->plan.view, view);
    return focus_distance_at(view, pixel_of(view));
  }
  search_ = Search{};
  return std::nullopt;
}

void DepthFeedback::follow(bool follows) {
  const std::lock_guard lock(mutex_);
  follows_ = follows;
  latest_.reset();
}

std::optional<double> DepthFeedback::take_found() {
  const std::lock_guard lock(mutex_);
  return std::exchange(found_, std::nullopt);
}

DepthFeedback::WaitResult DepthFeedback::wait_for(uint32_t sequence, std::chrono::milliseconds longest) {
  std::unique_lock lock(mutex_);
  // Sequence numbers wrap: the sign of the difference gives the order.
  const auto is_there = [&] {
    return latest_estimate_ && static_cast<int32_t>(latest_estimate_->sequence - sequence) >= 0;
  };
  changed_.wait_for(lock, longest, [&] { return unlocked_ || is_there(); });
  if (unlocked_) return WaitResult::kUnlocked;
  return is_there() ? WaitResult::kAvailable : WaitResult::kTimeout;
}

bool DepthFeedback::has_hypotheses() {
  const std::lock_guard lock(mutex_);
  return !unsent_.empty();
}

std::optional<ViewRequest> DepthFeedback::next_sweep(const ViewRequest& request, const Rig* rig) {
  const std::lock_guard lock(mutex_);
  requests_++;
  if (request.view.focus.map) return std::nullopt;
  if (!search_ && follows_ && requests_ >= kRest) search_ = Search{latest_, {}, 0};
  if (search_ && search_->sequence && requests_ > kPatience) {
    search_->sequence.reset();
    if (++search_->lost >= kMaxLost) search_.reset();
  }
  if (!search_ || search_->sequence) return std::nullopt;
  requests_ = 0;
  ViewRequest sweep = request;
  sweep.gains = {};
  sweep.probe = true;
  sweep.view = view_around(request.view, pixel_of(request.view));
  const Plane from = rig ? array_plane(*rig) : plane_through(sweep.view.pose.position, sweep.view.pose.forward());
  add_focus_sweep(sweep, from, search_->found, rig ? sweep_reach(*rig, sweep.view) : 0);
  return sweep;
}

void DepthFeedback::sweep_sent(uint32_t sequence) {
  const std::lock_guard lock(mutex_);
  if (search_) search_->sequence = sequence;
  sweep_sequences_.push_back(sequence);
  if (sweep_sequences_.size() > kMaxSwept) sweep_sequences_.pop_front();
}

void DepthFeedback::apply(ViewRequest& request) {
  DepthEstimator::Plan plan;
  {
    const std::lock_guard lock(mutex_);
    const View& view = request.view;
    now_ =
        -view.focus.plane.signed_distance(view.pose.position) / glm::dot(view.focus.plane.normal, view.pose.forward());
    if (!latest_estimate_ || !latest_estimate_->plan.view.focus.map) return;
    search_.reset();
    if (!unsent_.empty() && request.place.leads()) {
      request.hypotheses = std::move(unsent_.front());
      unsent_.pop_front();
    }
    request.gains = {.use = latest_estimate_->gains.use};
    if (request.place.leads()) std::swap(request.gains, latest_estimate_->gains);
    plan = latest_estimate_->plan;
  }
  apply_plan(plan, request);
}

void DepthFeedback::set_unlocked(bool unlocked) {
  const std::lock_guard lock(mutex_);
  unlocked_ = unlocked;
  changed_.notify_all();
}

void DepthFeedback::clear() {
  const std::lock_guard lock(mutex_);
  latest_estimate_.reset();
  unsent_.clear();
  search_.reset();
  sweep_sequences_.clear();
  found_.reset();
  latest_.reset();
}

DepthFeedback& RelayedDepths::view(uint32_t id) {
  if (!views_.contains(id) && views_.size() >= kMaxViews) views_.erase(views_.begin());
  return views_[id];
}

void RelayedDepths::announce(uint32_t view_id, DepthEstimate focus) {
  const std::lock_guard lock(mutex_);
  view(view_id).announce(std::move(focus));
}

bool RelayedDepths::apply(ViewRequest& request) {
  const std::lock_guard lock(mutex_);
  if (request.probe) {
    if (!request.hypotheses.empty()) view(request.view_id).sweep_sent(request.sequence);
    return false;
  }
  const auto found = views_.find(request.view_id);
  if (found == views_.end() || request.view.focus.map) return false;
  const Plane asked = request.view.focus.plane;
  found->second.apply(request);
  return request.view.focus.map || request.view.focus.plane != asked;
}

void RelayedDepths::clear() {
  const std::lock_guard lock(mutex_);
  views_.clear();
}

}  // namespace lf
