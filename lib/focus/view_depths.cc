// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/view_depths.h"

#include <utility>

#include "focus/warp_depth_map.h"

namespace lf {

void apply_plan(const DepthEstimator::Plan& plan, ViewRequest& request) {
  const View& view = request.view;
  // The mean belongs to another size of the view and cannot be used.
  if (view.width != plan.view.width || view.height != plan.view.height) request.gains.mean.clear();
  const bool serves = !request.hypotheses.empty() || request.gains.ask || !request.gains.mean.empty();
  if (plan.plane) request.view.focus.plane = *plan.plane;
  request.on_plane = plan.on_plane && serves;
  if (!plan.on_plane || serves) request.view.focus.map = warp_depth_map(plan.view, view);
  if (request.view.focus.map) return;
  // A view that is too large for a map cannot use hypotheses or a mean.
  request.hypotheses.clear();
  request.gains.ask = request.on_plane = false;
}

void apply_reference_view(const ViewRequest& leader, ViewRequest& beside) {
  beside.view.focus.plane = leader.view.focus.plane;
  const bool has_surface = leader.view.focus.map && !leader.on_plane;
  beside.view.focus.map = has_surface ? warp_depth_map(leader.view, beside.view) : nullptr;
  beside.on_plane = false;
  beside.hypotheses.clear();
  beside.gains = {.use = leader.gains.use};
}

GainRequest next_gains(ExposureSchedule& turns, bool use, bool has_hypotheses, const PhotoConsistency& brightness,
                       const GainSum& gains, uint32_t sequence) {
  GainRequest next{.use = use};
  if (!use) {
    turns = {};
    return next;
  }
  const bool came = brightness.columns > 0;
  next.ask = turns.next(has_hypotheses, came);
  if (!came) return next;
  next.mean = mean_luma(brightness, gains);
  next.mean_of = sequence;
  return next;
}

void ViewDepths::apply(ViewRequest& request) {
  if (!plan_ || !plan_->view.focus.map) return;
  request.hypotheses = std::exchange(plan_->hypotheses, {});
  request.gains = std::exchange(gains_, {.use = gains_.use});
  apply_plan(*plan_, request);
}

void ViewDepths::take(const ViewRequest& request, const Answers& answers, const FocusArray& array) {
  control_.adapt_interval(answers.complete);
  plan_ = control_.next(request, answers.moments, array);
  gains_ = next_gains(turns_, match_gains_ && control_.state().mixed, !plan_->hypotheses.empty(), answers.brightness,
                      answers.gains, request.sequence);
}

}  // namespace lf
