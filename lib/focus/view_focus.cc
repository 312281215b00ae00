// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/view_focus.h"

#include "focus/carry_over.h"

namespace lf {

void ViewFocus::apply(ViewRequest& request) const {
  if (!plan_ || !plan_->view.focus.map) return;
  request.trials = plan_->trials;
  if (plan_->plane) request.view.focus.plane = *plan_->plane;
  request.on_plane = plan_->on_plane && !request.trials.empty();  // without trials a plane needs no map
  if (!plan_->on_plane || request.on_plane) request.view.focus.map = carry_over(plan_->view, request.view);
}

void ViewFocus::take(const ViewRequest& request, std::span<const Moments> moments, const FocusArray& array,
                     bool complete) {
  control_.keep_up(complete);
  plan_ = control_.next(request, moments, array);
}

}  // namespace lf
