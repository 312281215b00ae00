// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <utility>

#include "base/error.h"
#include "compositor/lfcompositor_private.h"

// GstAggregator calls aggregate() when every pad has a buffer, which is when every node has answered: the last part of
// a node's answer stays on its pad until the picture is done. Live, that would leave all the work for the end and wait
// in vain for nodes that are gone: there lf_compositor_next_time() names the past as the next deadline whenever there
// is something to do.

using lf::CompositorStats;

void lf_compositor_use_rig(LfCompositor* self, std::shared_ptr<const lf::Rig> rig) {
  auto& state = *self->state;
  // What refers to the rig that was used before goes with it.
  state.rig = rig;
  state.focus.set_rig(rig);
  state.assembly.set_rig(rig);
  state.corners = rig ? lf::corner_cameras(*rig) : lf::CameraSet();
  state.extent = rig ? lf::array_extent(*rig) : 0;
  state.coverage.clear();
  state.warned_rig = false;
}

static void use_rig_for_health(LfCompositor* self, uint64_t hash) {
  if (self->state->health.use_rig(hash)) lf_compositor_announce_out_of_service(self);
}

static void take_new_rig(LfCompositor* self) {
  auto& state = *self->state;
  lf::ObjectLock lock(self);
  const std::unique_ptr<std::shared_ptr<const lf::Rig>> rig(std::exchange(self->new_rig, nullptr));
  lock.unlock();
  if (!rig) return;
  lf_compositor_use_rig(self, *rig);
  state.gone = {};
  if (!state.settings.partial) state.health.expect(*rig ? (*rig)->cameras.size() : 0);
  if (*rig) use_rig_for_health(self, (*rig)->hash());
}

void lf_compositor_forget_request(LfCompositor* self) {
  self->state->assembly.release();
  self->state->current.reset();
  for (lf::NodeInput* node : lf::NodeInputs(self->request)) node->forget();
}

void lf_compositor_drop_request(LfCompositor* self) {
  for (lf::NodeInput* node : lf::NodeInputs(self->request)) node->drop_answer();
  lf_compositor_forget_request(self);
  gst_aggregator_pad_drop_buffer(GST_AGGREGATOR_PAD(self->request));
}

// Where the next request's number is one before the last one's, what waits for later ones is thrown away.
static void note_sequence(LfCompositor* self, uint32_t sequence) {
  if (!self->state->past.begin(sequence)) return;
  GST_INFO_OBJECT(self, "requests go on at %u: their viewer has begun anew", sequence);
  for (lf::NodeInput* node : lf::NodeInputs(self->request)) node->forget_later();
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
        state.focus.begin();
        state.assembly.begin(*request, state.health.out_of_service());
        note_sequence(self, request->sequence);
        use_rig_for_health(self, state.assembly.rig_hash());
        lf_compositor_refresh_latency(self);
        state.current = std::move(request);
        state.bytes = 0;
        state.adding = 0;
        // Nothing can come of trials that it does not have: the next request's are on their way at once.
        if (!state.settings.partial && !state.current->probe && state.current->place.leads() &&
            !state.current->view.focus.map)
          lf_compositor_find_focus(self);
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

static GstFlowReturn compose(LfCompositor* self) {
  if (self->state->request_flushed.exchange(false)) lf_compositor_forget_request(self);
  const guint view_id = self->state->settings.view_id;
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
  const lf::NodeInputs nodes(self->request);
  for (lf::NodeInput* node : nodes) lf_compositor_take_answers(self, *node);
  const bool all_answered = std::ranges::none_of(
      nodes, [&](lf::NodeInput* node) { return node->is_awaited(live, self->state->settings.max_missed); });
  const GstClockTime due = lf_compositor_deadline(self);
  const bool late = GST_CLOCK_TIME_IS_VALID(due) && lf_compositor_clock_time(self) >= due;
  return all_answered || late ? lf_compositor_finish_request(self, nodes) : GST_AGGREGATOR_FLOW_NEED_DATA;
}

// What was thrown costs the request at the head its picture, and nothing else.
static GstFlowReturn abandon_request(LfCompositor* self) {
  self->state->stats.count(CompositorStats::kFailedPictures);
  lf_compositor_drop_request(self);
  return GST_FLOW_OK;
}

// What comes in is of no use any more. That is this view's matter alone: told upstream, it would end the others behind
// the same tee. Once nothing can come the base class is to rest: it calls aggregate() again and again while all of its
// pads have ended.
static GstFlowReturn drop_all(LfCompositor* self) {
  lf_compositor_forget_request(self);
  const lf::NodeInputs nodes(self->request);
  for (lf::NodeInput* node : nodes) node->drop_all();
  while (gst_aggregator_pad_drop_buffer(GST_AGGREGATOR_PAD(self->request))) {
  }
  const bool ended = gst_aggregator_pad_is_eos(GST_AGGREGATOR_PAD(self->request)) &&
                     std::ranges::all_of(nodes, [](lf::NodeInput* node) { return node->has_ended(); });
  return ended ? GST_FLOW_EOS : GST_AGGREGATOR_FLOW_NEED_DATA;
}

GstFlowReturn lf_compositor_aggregate(GstAggregator* agg, gboolean) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  auto& state = *self->state;
  if (state.over) return drop_all(self);
  GstFlowReturn flow = GST_FLOW_ERROR;
  try {
    state.settings = lf_compositor_settings(self);
    flow = compose(self);
  } catch (...) {
    lf::warn_of_current_exception(self);
    flow = lf::guarded(agg, GST_FLOW_ERROR, [self] { return abandon_request(self); });
  }
  switch (flow) {
    case GST_FLOW_OK: state.warned_unlinked = false; return flow;
    case GST_AGGREGATOR_FLOW_NEED_DATA: return flow;
    case GST_FLOW_FLUSHING: return GST_AGGREGATOR_FLOW_NEED_DATA;  // who stops or seeks it says so itself
    case GST_FLOW_NOT_LINKED:                                      // until it is linked again
      if (!std::exchange(state.warned_unlinked, true))
        GST_ELEMENT_WARNING(self, CORE, PAD, ("The source pad is linked with nothing: pictures are thrown away."),
                            (nullptr));
      return GST_AGGREGATOR_FLOW_NEED_DATA;
    case GST_FLOW_NOT_NEGOTIATED:  // elements post all other errors themselves
      if (!state.output.has_refused()) GST_ELEMENT_FLOW_ERROR(self, flow);
      break;
    default: break;
  }
  if (!state.output.has_begun()) return flow;  // the base class begins a stream to end it
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
  for (lf::NodeInput* node : lf::NodeInputs(self->request)) {
    if (node->has_news()) return 0;
    awaited = awaited || node->is_awaited(true, self->state->settings.max_missed);
  }
  return awaited ? time : 0;
}
