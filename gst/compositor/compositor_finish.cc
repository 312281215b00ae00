// SPDX-License-Identifier: LGPL-2.1-or-later
//
// How a request ends: with a picture, or left out because that would come too late.
#include <algorithm>
#include <utility>

#include "compositor/compositor_answer_pads.h"
#include "compositor/lfcompositor_private.h"

GST_DEBUG_CATEGORY_EXTERN(lf_compositor_debug);
#define GST_CAT_DEFAULT lf_compositor_debug

// Live, a view that is asked for and that no node ever answers.
static void note_silence(LfCompositor* self) {
  constexpr int64_t kPatience = 5 * G_USEC_PER_SEC;
  auto& talk = self->state->talk;
  if (talk.answered || talk.warned || !lf_compositor_is_live(self)) return;
  const int64_t now = g_get_monotonic_time();
  if (talk.asked_since == 0) talk.asked_since = now;
  if (now < talk.asked_since + kPatience) return;
  talk.warned = true;
  GST_ELEMENT_WARNING(self, STREAM, FAILED,
                      ("No node answers view %u: do its requests reach them, and their answers this compositor?",
                       self->state->current->view_id),
                      (nullptr));
}

// Makes room for the next request. What probes are answered with says nothing of the nodes that is not said anyway.
static void close_request(LfCompositor* self, const AnswerPads& pads, GstClockTime due) {
  auto& state = *self->state;
  note_silence(self);
  for (GstAggregatorPad* pad : pads) {
    NodeInput& node = lf_compositor_node_of(pad);
    const bool took_part = node.head == NodeInput::Head::kDone;
    node.missed = took_part || gst_aggregator_pad_is_eos(pad) ? 0 : node.missed + !state.current->probe;
    if (took_part && node.seen && !node.flushed) drop_head(pad, node);
    if (took_part) node.head = NodeInput::Head::kUnseen;
  }
  if (lf_compositor_is_live(self) && !state.current->probe) {
    state.past.push_back({state.current->sequence, due});
    if (state.past.size() > kMostPast) state.past.pop_front();
    lf_compositor_use_rig_for_health(self, state.assembly.rig_hash());
    lf::CameraRanges seeing = state.assembly.seeing();
    seeing.add(std::exchange(state.seeing_since, {}));
    if (state.health.picture(seeing)) lf_compositor_announce_out_of_service(self);
  }
  state.assembly.release();
  state.current.reset();
}

bool lf_compositor_is_complete(LfCompositor* self) {
  const lf::Assembly& assembly = self->state->assembly;
  return assembly.missing() == 0 && assembly.damaged() == 0;
}

GstFlowReturn lf_compositor_finish_request(LfCompositor* self, const AnswerPads& pads) {
  auto& state = *self->state;
  const int64_t answered = g_get_monotonic_time();
  const GstClockTime due = lf_compositor_deadline(self);
  if (state.current->probe && !self->partial) {
    lf_compositor_take_probe(self);
    close_request(self, pads, due);
    gst_aggregator_pad_drop_buffer(GST_AGGREGATOR_PAD(self->request));
    return GST_FLOW_OK;
  }
  state.focus.keep_up(lf_compositor_is_complete(self));
  GST_OBJECT_LOCK(self);
  state.focus.spare(self->trial_interval);
  GST_OBJECT_UNLOCK(self);
  // Before the picture is made: the next request may wait for it.
  if (!self->partial && state.current->view.focus.map) lf_compositor_find_focus(self);
  GstFlowReturn flow = GST_FLOW_OK;
  GstBuffer* out = lf_compositor_make_picture(self, &flow);
  if (!out) return flow;
  GstBuffer* request = gst_aggregator_pad_pop_buffer(GST_AGGREGATOR_PAD(self->request));
  if (!request) {  // flushed meanwhile
    gst_buffer_unref(out);
    lf_compositor_forget_request(self);
    return GST_FLOW_OK;
  }
  const GstClockTime pts = GST_BUFFER_PTS(request), duration = GST_BUFFER_DURATION(request);
  gst_buffer_unref(request);
  lf_compositor_follow_segment(self);
  lf_compositor_record(self, answered, pts);
  std::vector<GstBuffer*> moments;
  if (self->partial) {
    moments = lf_compositor_make_moments(self, self->node);
    for (GstBuffer* unit : moments) GST_BUFFER_PTS(unit) = pts;
  } else {
    lf_compositor_monitor(self);
  }
  out = lf_compositor_replace_incomplete(self, out);
  const uint64_t captured =
      state.current->target_time != lf::kNoTime ? state.current->target_time : state.assembly.actual_time();
  close_request(self, pads, due);
  if (!out) return GST_FLOW_OK;
  GST_BUFFER_PTS(out) = pts;
  GST_BUFFER_DURATION(out) = duration;
  if (!self->partial) lf_compositor_note_capture_time(out, captured);
  if (GST_CLOCK_TIME_IS_VALID(pts)) {
    GST_OBJECT_LOCK(self);
    GST_AGGREGATOR_PAD(GST_AGGREGATOR_SRC_PAD(self))->segment.position = pts;
    GST_OBJECT_UNLOCK(self);
  }
  // Where nothing is ever missing nothing is kept: downstream may then write into the picture.
  if (lf_compositor_is_live(self) && !self->partial) gst_buffer_replace(&state.last_picture, out);
  for (GstBuffer* unit : moments)
    if (flow == GST_FLOW_OK)
      flow = gst_aggregator_finish_buffer(GST_AGGREGATOR(self), unit);
    else
      gst_buffer_unref(unit);
  if (flow != GST_FLOW_OK) {
    gst_buffer_unref(out);
    return flow;
  }
  state.pushing = true;
  flow = gst_aggregator_finish_buffer(GST_AGGREGATOR(self), out);
  state.pushing = false;
  return flow;
}

std::optional<lf::QosWatch::Late> lf_compositor_is_too_late(LfCompositor* self) {
  auto& state = *self->state;
  if (state.current->probe) return std::nullopt;
  GstBuffer* request = gst_aggregator_pad_peek_buffer(GST_AGGREGATOR_PAD(self->request));
  if (!request) return std::nullopt;
  const GstClockTime time = lf_compositor_running_time(self, request);
  gst_buffer_unref(request);
  return state.qos.late(state.current->view_id, time);
}

void lf_compositor_skip_request(LfCompositor* self, const lf::QosWatch::Late& late) {
  auto& state = *self->state;
  lf_compositor_record_skipped(self, late);
  // Who waits for the surface that comes of it goes on.
  if (!self->partial && state.current->view.focus.map) lf_compositor_find_focus(self);
  state.skipped.push_back(state.current->sequence);
  if (state.skipped.size() > kMostPast) state.skipped.pop_front();
  for (GstAggregatorPad* pad : AnswerPads(self)) {
    NodeInput& node = lf_compositor_node_of(pad);
    if (node.head == NodeInput::Head::kDone && node.seen && !node.flushed) drop_head(pad, node);
  }
  lf_compositor_forget_request(self);
  gst_aggregator_pad_drop_buffer(GST_AGGREGATOR_PAD(self->request));
}
