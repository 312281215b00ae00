// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/depth_loop.h"

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
  if (const auto ahead = static_cast<int32_t>(header->sequence - request.sequence); ahead != 0) return {ahead, {}};
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
  control_.adapt_interval(complete);
  control_.set_min_interval(interval);
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
  }
  ViewRequest request = shown;
  if (!array_) {
    if (rig_)
      array_.emplace(*rig_);
    else
      array_.emplace(plane_through(request.view.pose.position, request.view.pose.forward()));
    if (!on_plane) request.view.focus.map = nullptr;
  }
  DepthEstimate found{.sequence = request.sequence, .plan = control_.next(request, answers_.moments, *array_)};
  found.gains = next_gains(exposure_schedule_, match_gains && !on_plane && control_.state().mixed,
                           !found.plan.hypotheses.empty(), answers_.brightness, answers_.gains, request.sequence);
  return found;
}

DepthEstimate DepthLoop::sweep(const ViewRequest& sweep) const {
  return {.sequence = sweep.sequence,
          .plan = DepthEstimator().next(sweep, answers_.moments, sweep.view.focus.map->from),
          .gains = sweep.gains};
}

}  // namespace lf
