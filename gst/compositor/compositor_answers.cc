// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>

#include "base/error.h"
#include "compositor/compositor_answer_pads.h"
#include "compositor/lfcompositor_private.h"

GST_DEBUG_CATEGORY_EXTERN(lf_compositor_debug);
#define GST_CAT_DEFAULT lf_compositor_debug

// GstAggregator calls aggregate() when every pad has a buffer, which is when every node has answered: the last part of
// a node's answer stays on its pad until the picture is done. Live, that would leave all the work for the end and wait
// in vain for nodes that are gone: there lf_compositor_next_time() names the past as the next deadline whenever there
// is something to do.

using lf::CompositorStats;

namespace {

void take_new_rig(LfCompositor* self) {
  auto& state = *self->state;
  GST_OBJECT_LOCK(self);
  const std::unique_ptr<std::shared_ptr<const lf::Rig>> rig(std::exchange(self->new_rig, nullptr));
  GST_OBJECT_UNLOCK(self);
  if (!rig) return;
  // What refers to the rig that was used before goes with it.
  state.focus_array.reset();
  state.rig = *rig;
  state.assembly.set_rig(*rig);
  state.extent = *rig ? lf::array_extent(**rig) : 0;
  state.coverage = {};
  state.warned_rig = false;
  if (!*rig) return;
  lf_compositor_use_rig_for_health(self, (*rig)->hash());
  if (!self->partial) state.health.expect((*rig)->cameras.size());
}

}  // namespace

guint lf_compositor_view_id(LfCompositor* self) {
  GST_OBJECT_LOCK(self);
  const guint view_id = self->view_id;
  GST_OBJECT_UNLOCK(self);
  return view_id;
}

void lf_compositor_forget_request(LfCompositor* self) {
  self->state->assembly.release();
  self->state->current.reset();
  for (GstAggregatorPad* pad : AnswerPads(self)) {
    NodeInput& node = lf_compositor_node_of(pad);
    node.head = NodeInput::Head::kUnseen;
    node.seen = nullptr;
    node.parts.clear();
  }
}

// Makes the first own request on the request pad the current one; it stays on the pad until it is answered, so that
// aggregation fires when the last answer arrives and not when the next request does.
static bool find_request(LfCompositor* self, guint view_id) {
  auto& state = *self->state;
  if (state.current) return true;
  take_new_rig(self);
  GstAggregatorPad* pad = GST_AGGREGATOR_PAD(self->request);
  while (GstBuffer* buffer = gst_aggregator_pad_peek_buffer(pad)) {
    std::string reason;
    std::optional<lf::ViewRequest> request = lf::decode_request_buffer(buffer, &reason);
    gst_buffer_unref(buffer);
    if (request && request->view_id == view_id) {
      try {
        lf_compositor_forget_request(self);
        lf_compositor_forget_moments(self);
        state.assembly.begin(*request);
        lf_compositor_note_sequence(self, request->sequence);
        lf_compositor_use_rig_for_health(self, state.assembly.rig_hash());
        lf_compositor_refresh_latency(self);
        state.current = std::move(request);
        state.current_bytes = 0;
        state.adding = 0;
        // Nothing can come of trials that it does not have: the next request's are on their way at once.
        if (!self->partial && !state.current->probe && !state.current->view.focus.map) lf_compositor_find_focus(self);
        return true;
      } catch (const lf::Error& error) {
        reason = error.what();
        request.reset();
      }
    }
    if (!request) {
      GST_WARNING_OBJECT(self, "dropped a view request: %s", reason.c_str());
      state.stats.count(CompositorStats::kBadRequests);
    }
    gst_aggregator_pad_drop_buffer(pad);
  }
  return false;
}

static bool is_awaited(LfCompositor* self, GstAggregatorPad* pad, bool live) {
  const NodeInput& node = lf_compositor_node_of(pad);
  if (node.answered() || gst_aggregator_pad_is_eos(pad)) return false;
  return !live || self->max_missed == 0 || node.missed <= self->max_missed;
}

static GstFlowReturn compose(LfCompositor* self) {
  if (self->state->request_flushed.exchange(false)) lf_compositor_forget_request(self);
  const guint view_id = lf_compositor_view_id(self);
  bool found = find_request(self, view_id);
  while (found) {
    const std::optional<lf::QosWatch::Late> late = lf_compositor_is_too_late(self);
    if (!late) break;
    lf_compositor_skip_request(self, *late);
    found = find_request(self, view_id);
  }
  if (!found)
    return gst_aggregator_pad_is_eos(GST_AGGREGATOR_PAD(self->request)) ? GST_FLOW_EOS : GST_AGGREGATOR_FLOW_NEED_DATA;
  const bool live = self->state->live = lf_compositor_is_live(self);
  const AnswerPads pads(self);
  for (GstAggregatorPad* pad : pads) lf_compositor_take_answers(self, pad);
  const bool all_answered =
      std::ranges::none_of(pads, [&](GstAggregatorPad* pad) { return is_awaited(self, pad, live); });
  const GstClockTime due = lf_compositor_deadline(self);
  const bool late = GST_CLOCK_TIME_IS_VALID(due) && lf_compositor_clock_time(self) >= due;
  return all_answered || late ? lf_compositor_finish_request(self, pads) : GST_AGGREGATOR_FLOW_NEED_DATA;
}

// What was thrown costs the request at the head its picture, and nothing else.
static GstFlowReturn abandon_request(LfCompositor* self) {
  self->state->stats.count(CompositorStats::kFailedPictures);
  for (GstAggregatorPad* pad : AnswerPads(self)) {
    NodeInput& node = lf_compositor_node_of(pad);
    if (node.head == NodeInput::Head::kDone && node.seen && !node.flushed) drop_head(pad, node);
  }
  lf_compositor_forget_request(self);
  gst_aggregator_pad_drop_buffer(GST_AGGREGATOR_PAD(self->request));
  return GST_FLOW_OK;
}

// What comes in is of no use any more. That is this view's matter alone: told upstream, it would end the others behind
// the same tee.
static GstFlowReturn drop_all(LfCompositor* self) {
  lf_compositor_forget_request(self);
  for (GstAggregatorPad* pad : AnswerPads(self))
    while (gst_aggregator_pad_drop_buffer(pad)) {
    }
  while (gst_aggregator_pad_drop_buffer(GST_AGGREGATOR_PAD(self->request))) {
  }
  return GST_AGGREGATOR_FLOW_NEED_DATA;
}

GstFlowReturn lf_compositor_aggregate(GstAggregator* agg, gboolean) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  auto& state = *self->state;
  if (state.over) return drop_all(self);
  GstFlowReturn flow = GST_FLOW_ERROR;
  try {
    flow = compose(self);
  } catch (...) {
    lf::warn_of_current_exception(self);
    flow = lf::guarded(agg, GST_FLOW_ERROR, [self] { return abandon_request(self); });
  }
  switch (flow) {
    case GST_FLOW_OK:
    case GST_AGGREGATOR_FLOW_NEED_DATA: return flow;
    case GST_FLOW_FLUSHING: return GST_AGGREGATOR_FLOW_NEED_DATA;  // who stops or seeks it says so itself
    default: break;
  }
  if (!state.negotiated) return flow;  // the base class begins a stream to end it
  GST_INFO_OBJECT(self, "the output has ended: %s", gst_flow_get_name(flow));
  state.over = true;
  gst_pad_push_event(GST_AGGREGATOR_SRC_PAD(self), gst_event_new_eos());
  return drop_all(self);
}

// Live (else it does not count), the running time that aggregate() is called at, less the latency, if not all pads have
// a buffer before. Called with GstAggregator's lock held: what asks it for the latency would wait for ever.
GstClockTime lf_compositor_next_time(GstAggregator* agg) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  GstBuffer* request = gst_aggregator_pad_peek_buffer(GST_AGGREGATOR_PAD(self->request));
  if (!request) return GST_CLOCK_TIME_NONE;
  const GstClockTime time = lf_compositor_running_time(self, request);
  gst_buffer_unref(request);
  if (!self->state->current) return 0;
  bool awaited = false;
  for (GstAggregatorPad* pad : AnswerPads(self)) {
    GstBuffer* head = gst_aggregator_pad_peek_buffer(pad);
    if (head) gst_buffer_unref(head);
    const NodeInput& node = lf_compositor_node_of(pad);
    if (head && head != node.seen && node.head != NodeInput::Head::kDone) return 0;
    awaited = awaited || is_awaited(self, pad, true);
  }
  return awaited ? time : 0;
}
