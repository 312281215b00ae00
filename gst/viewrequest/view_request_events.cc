// SPDX-License-Identifier: LGPL-2.1-or-later
#include <optional>
#include <utility>

#include "common/hold_event.h"
#include "common/picture_caps.h"
#include "common/view_feedback.h"
#include "viewrequest/lfviewrequest_private.h"

static bool push_upstream(LfViewRequest* self, GstEvent* event) {
  return self->state->relay.push_upstream(gst_event_ref(event));
}

// Every viewer behind the node's tee and funnel hears of it.
static gboolean take_delay(LfViewRequest* self, GstEvent* event, GstClockTime delay) {
  auto& state = *self->state;
  if (state.relay.is_on()) return push_upstream(self, event);
  lf::ObjectLock lock(self);
  const bool follows = !GST_CLOCK_TIME_IS_VALID(state.settings.capture_delay);
  lock.unlock();
  if (!follows || !gst_base_src_is_live(GST_BASE_SRC(self))) return TRUE;
  if (!state.auto_delay.take(delay, gst_util_get_timestamp())) return TRUE;
  GST_INFO_OBJECT(self, "capture delay: %" GST_TIME_FORMAT, GST_TIME_ARGS(state.auto_delay.delay()));
  gst_element_post_message(GST_ELEMENT(self), gst_message_new_latency(GST_OBJECT(self)));
  return TRUE;
}

static gboolean hold(LfViewRequest* self, GstEvent* event, bool held) {
  if (self->state->relay.is_on()) return push_upstream(self, event);
  self->state->turn.hold(gst_event_get_seqnum(event), held);
  return TRUE;
}

// The next requests of this view are focused so; false where cameras are told where to look (access).
static bool take_focus(LfViewRequest* self, lf::FoundFocus focus) {
  lf::ObjectLock lock(self);
  const bool can = self->state->settings.access == lf::Access::kSelf;
  lock.unlock();
  if (!can) return false;
  self->state->focus.announce(std::move(focus));
  if (const std::optional<double> found = self->state->focus.take_found())
    lf_view_request_set_focus_distance(self, *found);
  return true;
}

// Requests of the view get that surface here, because nobody upstream has taken it. False if the relay is not live.
static bool keep_focus(LfViewRequest* self, guint view_id, lf::FoundFocus focus) {
  if (!gst_base_src_is_live(GST_BASE_SRC(self))) return false;
  self->state->relayed_focus.announce(view_id, std::move(focus));
  return true;
}

// Cameras that the rig does not have are nobody's to name: every node would refuse the view's requests.
static void announce_out_of_service(LfViewRequest* self, guint view_id, lf::CameraSet cameras) {
  lf::ObjectLock lock(self);
  const std::shared_ptr<const lf::Rig> rig = self->state->stream ? self->state->stream->rig() : nullptr;
  lock.unlock();
  if (rig) std::erase_if(cameras, [&rig](lf::CameraIndex camera) { return camera >= rig->cameras.size(); });
  self->state->out_of_service.announce(view_id, std::move(cameras));
}

// Cameras out of service are named here for every view; all else is for whoever makes the view's requests, if it can be
// reached, and a surface for which nobody can is kept here. False if nobody takes any of it.
static gboolean take_feedback(LfViewRequest* self, GstEvent* event, lf::ViewFeedback feedback) {
  auto& state = *self->state;
  const bool for_all = feedback.out_of_service.has_value();
  if (for_all) announce_out_of_service(self, feedback.view_id, std::move(*feedback.out_of_service));
  if (!feedback.focus && feedback.extra_requests.empty()) return for_all;
  if (state.relay.is_on()) {
    const bool passed = push_upstream(self, event);
    const bool kept = !passed && feedback.focus && keep_focus(self, feedback.view_id, std::move(*feedback.focus));
    return passed || kept || for_all;
  }
  if (feedback.view_id != lf_view_request_view_id(self)) return for_all;
  bool taken = for_all || !feedback.extra_requests.empty();
  if (!feedback.extra_requests.empty()) state.extra.ask(std::move(feedback.extra_requests));
  if (feedback.focus) taken |= take_focus(self, std::move(*feedback.focus));
  return taken;
}

static gboolean lf_view_request_event(GstBaseSrc* base, GstEvent* event) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  if (lf::is_reverse_seek(event)) return FALSE;
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEEK && !self->state->sought.is_new(gst_event_get_seqnum(event))) return TRUE;
  if (bool held = false; lf::parse_hold(event, &held)) return hold(self, event, held);
  if (GstClockTime delay; lf::parse_capture_delay(event, &delay)) return take_delay(self, event, delay);
  if (std::optional<lf::ViewFeedback> feedback = lf::parse_view_feedback(event))
    return take_feedback(self, event, std::move(*feedback));
  if (guint view_id; lf::SharedCaps caps = lf::parse_picture_caps(event, &view_id))
    return !self->state->relay.is_on() && view_id == lf_view_request_view_id(self) &&
           lf_view_request_follow_caps(self, std::move(caps));
  if (!lf_view_request_is_steering(event))
    return GST_BASE_SRC_CLASS(g_type_class_peek(GST_TYPE_PUSH_SRC))->event(base, event);
  return self->state->relay.is_on() ? push_upstream(self, event) : lf_view_request_steer(self, event);
}

void lf_view_request_install_events(GstBaseSrcClass* klass) { klass->event = lf::callback<lf_view_request_event>; }
