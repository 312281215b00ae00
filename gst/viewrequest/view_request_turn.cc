// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <memory>
#include <optional>

#include "common/gst_wire.h"
#include "viewrequest/lfviewrequest_private.h"

GST_DEBUG_CATEGORY_EXTERN(lf_view_request_debug);
#define GST_CAT_DEFAULT lf_view_request_debug

// Of views of a file, too.
static lf::Blending current_blending(LfViewRequest* self) {
  const lf::Blending asked =
      lf::blending_of(self->control->viewpoint().aperture, static_cast<int>(self->settings->nearest_cameras));
  const lf::CameraAccess* access = self->stream->access();
  return access ? access->blending(asked) : asked;
}

GstClockTime lf_view_request_capture_delay(LfViewRequest* self) {
  GST_OBJECT_LOCK(self);
  const GstClockTime delay = self->settings->capture_delay;
  GST_OBJECT_UNLOCK(self);
  return GST_CLOCK_TIME_IS_VALID(delay) ? delay : self->auto_delay->delay();
}

gboolean lf_view_request_unlock(GstBaseSrc* base) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  GST_OBJECT_LOCK(self);
  self->unlocked = true;
  self->focus_feedback->set_unlocked(true);
  self->relay->set_unlocked(true);
  if (self->clock_id) gst_clock_id_unschedule(self->clock_id);
  g_cond_broadcast(&self->held_changed);
  GST_OBJECT_UNLOCK(self);
  return TRUE;
}

gboolean lf_view_request_unlock_stop(GstBaseSrc* base) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  GST_OBJECT_LOCK(self);
  self->unlocked = false;
  self->focus_feedback->set_unlocked(false);
  self->relay->set_unlocked(false);
  GST_OBJECT_UNLOCK(self);
  return TRUE;
}

// GstBaseSrc would wait after create(), with a request that is then a frame old: so the wait is here, before the view
// is looked at.
static GstFlowReturn wait_until(LfViewRequest* self, GstClock* clock, GstClockTime time, bool or_change = false) {
  GST_OBJECT_LOCK(self);
  if (self->unlocked || (or_change && self->changed)) {
    const GstFlowReturn flow = self->unlocked ? GST_FLOW_FLUSHING : GST_FLOW_OK;
    GST_OBJECT_UNLOCK(self);
    return flow;
  }
  self->waits_for_change = or_change;
  GstClockID id = self->clock_id = gst_clock_new_single_shot_id(clock, time);
  GST_OBJECT_UNLOCK(self);
  const GstClockReturn result = gst_clock_id_wait(id, nullptr);
  GST_OBJECT_LOCK(self);
  self->clock_id = nullptr;
  const bool ended = result == GST_CLOCK_UNSCHEDULED && !(or_change && self->changed && !self->unlocked);
  GST_OBJECT_UNLOCK(self);
  gst_clock_id_unref(id);
  return ended ? GST_FLOW_FLUSHING : GST_FLOW_OK;
}

// Waits for the slot's turn, or for a change before it. *leaves: the slot, with the times that it then has.
static GstFlowReturn wait_for_turn(LfViewRequest* self, GstClock* clock, GstClockTime base_time,
                                   GstClockTime capture_delay, const lf::RequestSlot& slot, lf::RequestSlot* leaves) {
  const GstClockTime turn = base_time + slot.pts + capture_delay;
  const GstClockTime early = std::min(slot.pts + capture_delay, slot.duration / 4 * 3);
  GST_OBJECT_LOCK(self);
  const bool eager = self->settings->eager && !slot.view;
  GST_OBJECT_UNLOCK(self);
  *leaves = slot;
  if (!eager) return wait_until(self, clock, turn);
  GstFlowReturn flow = wait_until(self, clock, turn - early);
  if (flow == GST_FLOW_OK) flow = wait_until(self, clock, turn, true);
  if (const GstClockTime now = gst_clock_get_time(clock); now < turn)
    *leaves = self->stream->ahead_of_turn(slot, now, base_time, capture_delay);
  return flow;
}

// Chooses the next slot of a live stream and waits for it.
static GstFlowReturn wait_live(LfViewRequest* self, std::optional<lf::RequestSlot>* slot, lf::RequestSlot* leaves) {
  g_autoptr(GstClock) clock = gst_element_get_clock(GST_ELEMENT(self));
  if (!clock) {
    GST_ELEMENT_ERROR(self, CORE, CLOCK, ("A live source of view requests needs a clock"), (nullptr));
    return GST_FLOW_ERROR;
  }
  const GstClockTime base_time = gst_element_get_base_time(GST_ELEMENT(self));
  const GstClockTime capture_delay = lf_view_request_capture_delay(self);
  *slot = self->stream->next_live(gst_clock_get_time(clock), base_time, capture_delay);
  return *slot ? wait_for_turn(self, clock, base_time, capture_delay, **slot, leaves) : GST_FLOW_EOS;
}

// A seek that others are still to take part in.
static GstFlowReturn wait_for_seek(LfViewRequest* self) {
  GST_OBJECT_LOCK(self);
  while (self->held_for != GST_SEQNUM_INVALID && !self->unlocked)
    g_cond_wait(&self->held_changed, GST_OBJECT_GET_LOCK(self));
  const bool unlocked = self->unlocked;
  GST_OBJECT_UNLOCK(self);
  return unlocked ? GST_FLOW_FLUSHING : GST_FLOW_OK;
}

static GstFlowReturn make_request(LfViewRequest* self, GstBuffer** out) {
  const bool live = gst_base_src_is_live(GST_BASE_SRC(self));
  std::optional<lf::RequestSlot> turn;
  lf::RequestSlot slot{};
  if (live) {
    const GstFlowReturn flow = wait_live(self, &turn, &slot);
    if (flow != GST_FLOW_OK) return flow;
  } else {
    GstFlowReturn flow = wait_for_seek(self);
    if (flow == GST_FLOW_OK) flow = lf_view_request_wait_for_focus(self);
    if (flow != GST_FLOW_OK) return flow;
    turn = self->stream->next();
    if (!turn) return GST_FLOW_EOS;
    slot = *turn;
  }
  if (!slot.view) gst_object_sync_values(GST_OBJECT(self), slot.pts);

  lf::ViewRequest request;
  request.target_time = slot.target_time;
  request.absolute_time = live;
  request.sequence = self->stream->advance(*turn);
  lf::ObjectLock lock(self);
  request.rig_hash = self->stream->rig_hash();
  const std::shared_ptr<const lf::Rig> rig = self->stream->rig();
  request.view_id = self->settings->view_id;
  request.quality = static_cast<uint8_t>(self->settings->quality);
  request.out_of_service = self->out_of_service->with_announced(request.view_id, self->stream->out_of_service());
  request.view = lf::seen_beside(slot.view ? *slot.view : lf_view_request_view(self), self->settings->eye_offset);
  request.view.blending = current_blending(self);
  self->changed = false;
  lock.unlock();

  // Cameras that are told where to look try no depths: their pictures are of the viewer's plane.
  if (!self->stream->access()) self->focus_feedback->apply(request);
  self->has_sent = true;
  self->last_sequence = request.sequence;
  *out = lf::encode_request_buffer(request);
  GST_BUFFER_PTS(*out) = slot.pts;
  GST_BUFFER_DURATION(*out) = slot.duration;
  GST_LOG_OBJECT(self, "request %u of view %u for %" GST_TIME_FORMAT, request.sequence, request.view_id,
                 GST_TIME_ARGS(request.target_time));
  lf_view_request_send_more(self, request, rig, *out);
  return GST_FLOW_OK;
}

static GstFlowReturn make_buffer(LfViewRequest* self, GstBuffer** out) {
  if ((*out = static_cast<GstBuffer*>(gst_queue_array_pop_head(self->to_send)))) return GST_FLOW_OK;
  if (self->requests_left == 0) return GST_FLOW_EOS;
  const GstFlowReturn flow =
      lf_view_request_is_relay(self) ? lf_view_request_relay(self, out) : make_request(self, out);
  if (flow == GST_FLOW_OK && self->requests_left > 0) self->requests_left--;
  return flow;
}

// What is thrown costs the request that was being made; where this goes on and on, it ends the stream.
GstFlowReturn lf_view_request_create(GstPushSrc* push, GstBuffer** out) {
  constexpr int kMostInARow = 32;
  LfViewRequest* self = LF_VIEW_REQUEST(push);
  GstBuffer* made = nullptr;
  for (int i = 0; i < kMostInARow; i++) {
    const uint64_t turn = self->stream->turn();
    try {
      const GstFlowReturn flow = make_buffer(self, &made);
      if (flow == GST_FLOW_OK) *out = made;
      return flow;
    } catch (...) {
      gst_clear_buffer(&made);
      lf::warn_of_current_exception(self);
      self->stream->pass(turn);
    }
  }
  return lf::guarded(push, GST_FLOW_ERROR, [=] { return make_buffer(self, out); });
}
