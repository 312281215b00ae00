// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/depth_loop.h"

#include <algorithm>
#include <utility>

#include "composite/assembly.h"
#include "wire/consistency_codec.h"

namespace lf {

void DepthLoop::clear() {
  std::shared_ptr<const Rig> rig = std::move(rig_);
  *this = {};
  rig_ = std::move(rig);
}

void DepthLoop::set_rig(std::shared_ptr<const Rig> rig) {
  rig_ = std::move(rig);
  array_.reset();
}

void DepthLoop::begin() {
  answers_ = {};
  bytes_ = 0;
}

DepthLoop::Taken DepthLoop::take(std::span<const uint8_t> unit, const ViewRequest& request) {
  std::string reason;
  const std::optional<wire::ConsistencyHeader> header = wire::parse_consistency_header(unit, nullptr, &reason);
  if (!header) return {-1, reason};
  if (header->view_id != request.view_id) return {-1, {}};
  // Sequence numbers wrap: the sign of the difference gives the order.
  if (const auto ahead = static_cast<int32_t>(header->sequence - request.sequence); ahead != 0) {
    const auto late =
        std::ranges::find(pending_, header->sequence, [](const Pending& pending) { return pending.request.sequence; });
    if (late != pending_.end()) reason = add_consistency(unit, *header, late->request, late->answers);
    return {ahead, reason};
  }
  reason = add_consistency(unit, *header, request, answers_);
  if (reason.empty()) bytes_ += unit.size();
  return {0, reason};
}

std::vector<ByteBuffer> DepthLoop::units(const ViewRequest& request, uint64_t rig_hash, uint32_t node) const {
  wire::ConsistencyHeader header{request.view_id, request.sequence, rig_hash, node, {}};
  std::vector<ByteBuffer> units;
  if (!answers_.moments.empty()) units.push_back(wire::encode_consistency(header, answers_.moments));
  header.gains = answers_.gains;
  if (answers_.brightness.columns > 0) units.push_back(wire::encode_consistency(header, {&answers_.brightness, 1}));
  return units;
}

void DepthLoop::adapt_rate(bool complete, unsigned interval) {
  is_complete_ = complete;
  control_.adapt_interval(complete);
  control_.set_min_interval(interval);
}

// Returns the request that the next estimate is based on: `request`, which the current sums belong to, or an earlier
// one whose sums were late. Returns nothing if the sums of all of them may still arrive. Requests with hypotheses keep
// their order.
std::optional<DepthLoop::Pending> DepthLoop::take_pending(const ViewRequest& request) {
  for (Pending& pending : pending_) pending.age++;
  const bool may_come = !request.hypotheses.empty() && answers_.moments.empty() && !is_complete_;
  if (pending_.empty() && !may_come) return Pending{request, std::move(answers_)};
  if (!request.hypotheses.empty()) pending_.push_back({request, std::move(answers_)});
  const Pending& first = pending_.front();
  if (first.answers.moments.empty() && first.age < kPatience && pending_.size() <= kMaxPending) return {};
  Pending next = std::move(pending_.front());
  pending_.pop_front();
  return next;
}

std::optional<DepthEstimate> DepthLoop::next(const ViewRequest& shown, const DepthEstimator::Settings& settings,
                                             bool match_gains) {
  if (!shown.view.focus.map && requests_until_retry_ > 0) {
    requests_until_retry_--;
    return {};
  }
  const bool on_plane = settings.mode == FocusMode::kPlane;
  if (on_plane && settings_.mode == FocusMode::kPlane) return {};
  if (settings != settings_) {
    settings_ = settings;
    control_ = DepthEstimator(settings);
    array_.reset();
    pending_.clear();
  }
  std::optional<Pending> based_on = take_pending(shown);
  if (!based_on) {
    based_on = {.request = shown, .answers = {}};
    based_on->request.hypotheses.clear();
  }
  auto& [request, answers, age] = *based_on;
  if (!array_) {
    if (rig_)
      array_.emplace(*rig_);
    else
      array_.emplace(plane_through(request.view.pose.position, request.view.pose.forward()));
    if (!on_plane) request.view.focus.map = nullptr;
  }
  DepthEstimate found{.sequence = request.sequence, .plan = control_.next(request, answers.moments, *array_)};
  found.gains = next_gains(exposure_schedule_, match_gains && !on_plane && control_.state().mixed,
                           !found.plan.hypotheses.empty(), answers.brightness, answers.gains, request.sequence);
  return found;
}

DepthEstimate DepthLoop::sweep(const ViewRequest& sweep) const {
  return {.sequence = sweep.sequence,
          .plan = DepthEstimator().next(sweep, answers_.moments, sweep.view.focus.map->from),
          .gains = sweep.gains};
}

}  // namespace lf
