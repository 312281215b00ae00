// SPDX-License-Identifier: LGPL-2.1-or-later
#include "viewrequest/focus_wait.h"

#include "common/view_feedback.h"

GST_DEBUG_CATEGORY_EXTERN(lf_view_request_debug);
#undef GST_CAT_DEFAULT  // of another file that is compiled in one with this
#define GST_CAT_DEFAULT lf_view_request_debug

namespace lf {

GstFlowReturn FocusWait::wait(guint view_id) {
  using Waited = FocusFeedback::Waited;
  constexpr std::chrono::milliseconds kLongest{5000};
  if (!awaits_) awaits_ = is_focus_found(src_, view_id);
  if (!*awaits_ || !last_) return GST_FLOW_OK;
  bool paused = true;
  while (paused) {
    const Waited waited = feedback_.wait_for(*last_, kLongest);
    if (waited != Waited::kTooLong) return waited == Waited::kCame ? GST_FLOW_OK : GST_FLOW_FLUSHING;
    // Pictures that nobody takes are no reason to go on without: they are to be the same however long that lasts.
    is_focus_found(src_, view_id, &paused);
  }
  GST_WARNING_OBJECT(src_, "no focal surface came of request %u: it is not waited for any more", *last_);
  awaits_ = false;
  return GST_FLOW_OK;
}

bool FocusWait::rehearses() {
  constexpr unsigned kMost = 8;  // a search, and rounds that better what it found
  rehearses_ = awaits_.value_or(false) && rehearsals_ < kMost && (rehearsals_ == 0 || feedback_.has_trials());
  rehearsals_ = rehearses_ ? rehearsals_ + 1 : kMost;
  return rehearses_;
}

}  // namespace lf
