// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <memory>
#include <optional>
#include <vector>

#include "common/day_clock.h"
#include "common/gst_wire.h"
#include "viewrequest/lfviewrequest_private.h"

// Of views of a file, too.
static lf::Blending current_blending(LfViewRequest* self) {
  const lf::Blending asked = lf::blending_of(self->state->control.viewpoint().aperture,
                                             static_cast<int>(self->state->settings.nearest_cameras));
  const lf::CameraAccess* access = self->state->stream->access();
  return access ? access->blending(asked) : asked;
}

GstClockTime lf_view_request_capture_delay(LfViewRequest* self) {
  lf::ObjectLock lock(self);
  const GstClockTime delay = self->state->settings.capture_delay;
  lock.unlock();
  return GST_CLOCK_TIME_IS_VALID(delay) ? delay : self->state->auto_delay.delay();
}

static gboolean set_unlocked(GstBaseSrc* base, bool unlocked) {
  auto& state = *LF_VIEW_REQUEST(base)->state;
  state.focus.set_unlocked(unlocked);
  state.relay.set_unlocked(unlocked);
  state.turn.set_unlocked(unlocked);
  return TRUE;
}

gboolean lf_view_request_unlock(GstBaseSrc* base) { return set_unlocked(base, true); }
gboolean lf_view_request_unlock_stop(GstBaseSrc* base) { return set_unlocked(base, false); }

// Waits for the slot's turn, or for a change before it. *leaves: the slot, with the times that it then has.
// The schedule counts in the time of day: `offset` is that less clock time.
static GstFlowReturn wait_for_turn(LfViewRequest* self, GstClock* clock, GstClockTimeDiff offset,
                                   GstClockTime capture_delay, const lf::RequestSlot& slot, lf::RequestSlot* leaves) {
  const GstClockTime base_time = gst_element_get_base_time(GST_ELEMENT(self));
  const GstClockTime turn = base_time + slot.pts + capture_delay;
  const GstClockTime early = std::min(slot.pts + capture_delay, slot.duration / 4 * 3);
  GST_OBJECT_LOCK(self);
  const bool eager = self->state->settings.eager && !slot.view;
  GST_OBJECT_UNLOCK(self);
  *leaves = slot;
  if (!eager) return self->state->turn.wait_until(clock, turn);
  GstFlowReturn flow = self->state->turn.wait_until(clock, turn - early);
  if (flow == GST_FLOW_OK) flow = self->state->turn.wait_until(clock, turn, true);
  if (const GstClockTime now = gst_clock_get_time(clock); now < turn)
    *leaves = self->state->stream->schedule.ahead_of_turn(slot, now + offset, base_time + offset, capture_delay);
  return flow;
}

// Chooses the next slot of a live stream and waits for it.
static GstFlowReturn wait_live(LfViewRequest* self, std::optional<lf::RequestSlot>* slot, lf::RequestSlot* leaves) {
  g_autoptr(GstClock) clock = gst_element_get_clock(GST_ELEMENT(self));
  if (!clock) {
    GST_ELEMENT_ERROR(self, CORE, CLOCK, ("A live source of view requests needs a clock"), (nullptr));
    return GST_FLOW_ERROR;
  }
  const GstClockTimeDiff offset = lf::day_offset(GST_ELEMENT(self));
  const GstClockTime base_time = gst_element_get_base_time(GST_ELEMENT(self));
  const GstClockTime capture_delay = lf_view_request_capture_delay(self);
  *slot =
      self->state->stream->schedule.next_live(gst_clock_get_time(clock) + offset, base_time + offset, capture_delay);
  return *slot ? wait_for_turn(self, clock, offset, capture_delay, **slot, leaves) : GST_FLOW_EOS;
}

// The requests for the other views of the set around `middle`, of the moment and with the surface of the one that
// leads.
static std::vector<lf::ViewRequest> rest_of_set(const lf::ViewRequest& leader, const lf::ViewSet& set,
                                                const lf::View& middle) {
  std::vector<lf::ViewRequest> rest;
  for (const lf::PlaceInSet& place : set.places()) {
    if (place.leads()) continue;
    lf::ViewRequest& beside = rest.emplace_back(leader);
    beside.place = place;
    beside.view = set.view(middle, place);
    lf::apply_leader(leader, beside);
  }
  return rest;
}

static GstFlowReturn make_request(LfViewRequest* self, GstBuffer** out) {
  const bool live = gst_base_src_is_live(GST_BASE_SRC(self));
  std::optional<lf::RequestSlot> turn;
  lf::RequestSlot slot{};
  bool rehearsal = false;
  if (live) {
    GstFlowReturn flow = lf_view_request_follow_rate(self);
    if (flow == GST_FLOW_OK) flow = wait_live(self, &turn, &slot);
    if (flow != GST_FLOW_OK) return flow;
  } else {
    GstFlowReturn flow = self->state->turn.wait_for_seek();
    if (flow == GST_FLOW_OK && !self->state->stream->access())
      flow = self->state->focus_wait.wait(lf_view_request_view_id(self));
    if (flow != GST_FLOW_OK) return flow;
    rehearsal = self->state->focus_wait.rehearses();
    if (!rehearsal) flow = lf_view_request_follow_rate(self);
    if (flow != GST_FLOW_OK) return flow;
    turn = self->state->stream->schedule.next();
    if (!turn) return GST_FLOW_EOS;
    slot = *turn;
  }
  if (!slot.view) gst_object_sync_values(GST_OBJECT(self), slot.pts);

  lf::ViewRequest request;
  request.target_time = slot.target_time;
  request.absolute_time = live;
  request.rehearsal = rehearsal;
  if (!rehearsal) self->state->stream->schedule.advance(*turn);
  request.sequence = self->state->stream->next_number++;
  lf::ObjectLock lock(self);
  request.rig_hash = self->state->stream->rig_hash();
  const std::shared_ptr<const lf::Rig> rig = self->state->stream->rig();
  request.view_id = self->state->settings.view_id;
  request.quality = self->state->in_process ? 0 : static_cast<uint8_t>(self->state->settings.quality);
  request.out_of_service =
      self->state->out_of_service.with_announced(request.view_id, self->state->stream->out_of_service());
  const lf::ViewSet set = self->state->settings;
  lf::View middle = slot.view ? *slot.view : lf_view_request_view(self);
  middle.blending = current_blending(self);
  request.place = set.places().front();
  request.view = set.view(middle, request.place);
  self->state->turn.forget_change();
  lock.unlock();

  // Cameras that are told where to look try no depths: their pictures are of the viewer's plane.
  if (!self->state->stream->access()) self->state->focus.apply(request);
  self->state->focus_wait.sent(request.sequence);
  *out = lf::encode_request_buffer(request);
  GST_BUFFER_PTS(*out) = slot.pts;
  GST_BUFFER_DURATION(*out) = slot.duration;
  GST_LOG_OBJECT(self, "request %u of view %u for %" GST_TIME_FORMAT, request.sequence, request.view_id,
                 GST_TIME_ARGS(request.target_time));
  if (!rehearsal) lf_view_request_send_more(self, request, rig, *out, rest_of_set(request, set, middle));
  return GST_FLOW_OK;
}

static GstFlowReturn make_buffer(LfViewRequest* self, GstBuffer** out) {
  gint& left = self->state->requests_left;
  if ((*out = self->state->outbox.take())) return GST_FLOW_OK;
  if (left == 0) return GST_FLOW_EOS;
  const GstFlowReturn flow = self->state->relay.is_on() ? lf_view_request_relay(self, out) : make_request(self, out);
  if (flow == GST_FLOW_OK && left > 0 && !self->state->focus_wait.is_rehearsing()) left--;
  return flow;
}

// What is thrown costs the request that was being made; where this goes on and on, it ends the stream.
GstFlowReturn lf_view_request_create(GstPushSrc* push, GstBuffer** out) {
  constexpr int kMostInARow = 32;
  LfViewRequest* self = LF_VIEW_REQUEST(push);
  GstBuffer* made = nullptr;
  for (int i = 0; i < kMostInARow; i++) {
    const uint64_t turn = self->state->stream->schedule.turn();
    try {
      const GstFlowReturn flow = make_buffer(self, &made);
      if (flow == GST_FLOW_OK) *out = made;
      return flow;
    } catch (...) {
      gst_clear_buffer(&made);
      lf::warn_of_current_exception(self);
      self->state->stream->schedule.pass(turn);
    }
  }
  return lf::guarded(push, GST_FLOW_ERROR, [=] { return make_buffer(self, out); });
}
