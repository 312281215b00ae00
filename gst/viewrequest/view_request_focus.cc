// SPDX-License-Identifier: LGPL-2.1-or-later
#include <cmath>

#include "common/view_feedback.h"
#include "viewrequest/lfviewrequest_private.h"

GST_DEBUG_CATEGORY_EXTERN(lf_view_request_debug);
#define GST_CAT_DEFAULT lf_view_request_debug

static void set_focus_distance(LfViewRequest* self, double distance) {
  lf_view_request_change_view(self, [distance](lf::ViewControl& control) {
    control.set(lf::kFieldFocus, distance);
    return TRUE;
  });
}

gboolean lf_view_request_focus_at(LfViewRequest* self, gdouble x, gdouble y) {
  if (!std::isfinite(x) || !std::isfinite(y)) return FALSE;
  GST_OBJECT_LOCK(self);
  // Cameras that are told where to look (access) try nothing.
  const bool can = self->stream && !self->stream->from_file() && !self->stream->access();
  const lf::View view = can ? lf_view_request_view(self) : lf::View();
  GST_OBJECT_UNLOCK(self);
  if (!can) return FALSE;
  const lf::Vec2 place((x + 0.5) / view.width, (y + 0.5) / view.height);
  if (place.x < 0 || place.x > 1 || place.y < 0 || place.y > 1) return FALSE;
  if (const std::optional<double> distance = self->focus_feedback->focus_at(place)) set_focus_distance(self, *distance);
  return TRUE;
}

bool lf_view_request_take_focus(LfViewRequest* self, lf::FoundFocus focus) {
  GST_OBJECT_LOCK(self);
  const bool can = self->settings->access == lf::Access::kSelf;
  GST_OBJECT_UNLOCK(self);
  if (!can) return false;
  self->focus_feedback->announce(std::move(focus));
  if (const std::optional<double> found = self->focus_feedback->take_found()) set_focus_distance(self, *found);
  return true;
}

GstFlowReturn lf_view_request_wait_for_focus(LfViewRequest* self) {
  constexpr std::chrono::milliseconds kLongest{5000};
  if (!self->asked_for_focus) {
    GST_OBJECT_LOCK(self);
    const guint view_id = self->settings->view_id;
    GST_OBJECT_UNLOCK(self);
    self->awaits_focus = !self->stream->access() && lf::is_focus_found(GST_BASE_SRC_PAD(self), view_id);
    self->asked_for_focus = true;
  }
  if (!self->awaits_focus || !self->has_sent) return GST_FLOW_OK;
  bool paused = true;
  while (paused) {
    if (self->focus_feedback->wait_for(self->last_sequence, kLongest)) return GST_FLOW_OK;
    GST_OBJECT_LOCK(self);
    const bool unlocked = self->unlocked;
    const guint view_id = self->settings->view_id;
    GST_OBJECT_UNLOCK(self);
    if (unlocked) return GST_FLOW_FLUSHING;
    // Pictures that nobody takes are no reason to go on without: they are to be the same however long that lasts.
    lf::is_focus_found(GST_BASE_SRC_PAD(self), view_id, &paused);
  }
  GST_WARNING_OBJECT(self, "no focal surface came of request %u: it is not waited for any more", self->last_sequence);
  self->awaits_focus = false;
  return GST_FLOW_OK;
}
