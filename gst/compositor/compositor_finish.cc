// SPDX-License-Identifier: LGPL-2.1-or-later
//
// How a request ends: with a picture, or left out because that would come too late.
#include <utility>
#include <vector>

#include "compositor/lfcompositor_private.h"

// Nodes that say nothing, while others do.
static void warn_of_silent(LfCompositor* self, const std::vector<lf::NodeInput*>& nodes) {
  for (lf::NodeInput* node : nodes) {
    const char* const hint =
        node->silence().ever_answered()
            ? "any more: is its host, and the way to it, still there?"
            : "though other nodes answer: do requests reach it, and has it the same key-file, if any?";
    GST_ELEMENT_WARNING(self, STREAM, FAILED, ("Nothing comes from a node (%s) %s", node->name().c_str(), hint),
                        (nullptr));
  }
}

// Live, a view that is asked for and that no node answers, or not every one.
static void note_silence(LfCompositor* self, const lf::NodeInputs& nodes) {
  if (!lf_compositor_is_live(self)) return;
  const gint64 now = g_get_monotonic_time();
  lf::SilenceWatch& silence = self->state->silence;
  std::vector<lf::NodeInput*> silent;
  for (lf::NodeInput* node : nodes)
    if (!node->has_ended() && node->silence().composed(now)) silent.push_back(node);
  if (!silence.composed(now)) {
    if (!silence.is_silent()) warn_of_silent(self, silent);
    return;
  }
  if (silence.ever_answered()) {
    GST_ELEMENT_WARNING(self, STREAM, FAILED,
                        ("No node answers view %u any more: are their hosts, and the way to them, still there?",
                         self->state->current->view_id),
                        (nullptr));
    return;
  }
  GST_ELEMENT_WARNING(
      self, STREAM, FAILED,
      ("No node answers view %u: do its requests reach them, and their answers this compositor? Those on "
       "other hosts need the same key-file as this viewer, and none if it has none.",
       self->state->current->view_id),
      (nullptr));
}

// Makes room for the next request. What probes are answered with says nothing of the nodes that is not said anyway.
static void close_request(LfCompositor* self, const lf::NodeInputs& nodes, GstClockTime due) {
  auto& state = *self->state;
  note_silence(self, nodes);
  // Of a set, which is of one moment, one view counts.
  const bool counts = !state.current->probe && state.current->place.leads();
  for (lf::NodeInput* node : nodes) node->close(counts);
  if (lf_compositor_is_live(self) && !state.current->probe) state.past.composed(state.current->sequence, due);
  state.gone = lf_compositor_is_live(self) ? lf::CameraRanges() : state.assembly.blind();
  if (lf_compositor_is_live(self) && counts) {
    const bool reset = state.health.use_rig(state.assembly.rig_hash());
    if (state.health.picture(state.assembly.seeing()) || reset) lf_compositor_announce_out_of_service(self);
  }
  state.assembly.release();
  state.current.reset();
}

static GstBuffer* make_output(LfCompositor* self, GstFlowReturn* flow) {
  auto& state = *self->state;
  const lf::CompositorSettings& settings = state.settings;
  if (settings.partial)
    return state.output.make_answer(state.assembly, *state.current, settings.node, settings.codec, flow);
  const guint32 argb = settings.background;
  const lf::Background background{static_cast<uint8_t>(argb >> 16), static_cast<uint8_t>(argb >> 8),
                                  static_cast<uint8_t>(argb)};
  bool dropped = false;
  state.output.show(settings.show, state.rig);
  GstBuffer* picture = state.output.make_picture(state.assembly, *state.current, background, flow, &dropped);
  if (dropped) state.stats.count(lf::CompositorStats::kDroppedPictures);
  if (picture && state.output.is_on_card()) state.stats.count(lf::CompositorStats::kCardPictures);
  return picture;
}

// What came of trials goes on before a partial answer.
static GstFlowReturn push_moments(LfCompositor* self, GstClockTime pts) {
  auto& state = *self->state;
  for (lf::ByteBuffer& bytes : state.focus.units(*state.current, state.assembly.rig_hash(), state.settings.node)) {
    GstBuffer* unit = lf::wrap_bytes(std::move(bytes));
    GST_BUFFER_PTS(unit) = pts;
    const GstFlowReturn flow = gst_aggregator_finish_buffer(GST_AGGREGATOR(self), unit);
    if (flow != GST_FLOW_OK) return flow;
  }
  return GST_FLOW_OK;
}

static void replace_incomplete(LfCompositor* self, GstBuffer** picture) {
  auto& state = *self->state;
  switch (state.output.replace_incomplete(state.assembly, state.settings.incomplete, picture)) {
    case lf::PictureOutput::Shown::kRepeated: return state.stats.count(lf::CompositorStats::kRepeatedPictures);
    case lf::PictureOutput::Shown::kDropped: return state.stats.count(lf::CompositorStats::kDroppedPictures);
    default: return;
  }
}

GstFlowReturn lf_compositor_finish_request(LfCompositor* self, const lf::NodeInputs& nodes) {
  auto& state = *self->state;
  const bool partial = state.settings.partial;
  const int64_t answered = g_get_monotonic_time();
  const GstClockTime due = lf_compositor_deadline(self);
  if (state.current->probe && !partial) {
    lf_compositor_take_probe(self);
    close_request(self, nodes, due);
    gst_aggregator_pad_drop_buffer(GST_AGGREGATOR_PAD(self->request));
    return GST_FLOW_OK;
  }
  const bool leads = state.current->place.leads();
  // Rehearsals are for trials alone: an interval would show the first picture before the surface is found.
  const guint trial_interval = state.current->rehearsal ? 1 : state.settings.trial_interval;
  if (leads) state.focus.keep_pace(state.assembly.complete(), trial_interval);
  // Before the picture is made: the next request may wait for it.
  if (!partial && leads && state.current->view.focus.map) lf_compositor_find_focus(self);
  if (!partial && state.current->rehearsal) {
    close_request(self, nodes, due);
    gst_aggregator_pad_drop_buffer(GST_AGGREGATOR_PAD(self->request));
    return GST_FLOW_OK;
  }
  GstFlowReturn flow = GST_FLOW_OK;
  GstBuffer* out = make_output(self, &flow);
  if (!out && flow != GST_FLOW_OK) return flow;
  GstBuffer* request = gst_aggregator_pad_pop_buffer(GST_AGGREGATOR_PAD(self->request));
  if (!request) {  // flushed meanwhile
    gst_clear_buffer(&out);
    lf_compositor_forget_request(self);
    return GST_FLOW_OK;
  }
  const GstClockTime pts = GST_BUFFER_PTS(request), duration = GST_BUFFER_DURATION(request);
  gst_buffer_unref(request);
  state.output.follow_segment(GST_AGGREGATOR_PAD(self->request)->segment);
  lf_compositor_record(self, nodes, answered, pts);
  if (partial)
    flow = push_moments(self, pts);
  else if (leads)
    lf_compositor_monitor(self);
  if (out) replace_incomplete(self, &out);
  const uint64_t captured = lf_compositor_capture_time(self);
  close_request(self, nodes, due);
  if (!out) return GST_FLOW_OK;
  if (flow != GST_FLOW_OK) {
    gst_buffer_unref(out);
    return flow;
  }
  GST_BUFFER_PTS(out) = pts;
  GST_BUFFER_DURATION(out) = duration;
  if (!partial) {
    lf_compositor_note_capture_time(out, captured);
    state.view_meta.attach(out);
  }
  // Where nothing is ever missing nothing is kept: downstream may then write into the picture.
  return state.output.push(out, pts, lf_compositor_is_live(self) && !partial);
}

std::optional<lf::QosWatch::Late> lf_compositor_is_too_late(LfCompositor* self) {
  auto& state = *self->state;
  if (state.current->probe || state.current->rehearsal || state.output.is_drawing(*state.current)) return std::nullopt;
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
  if (!state.settings.partial && state.current->place.leads() && state.current->view.focus.map)
    lf_compositor_find_focus(self);
  state.past.skipped(state.current->sequence);
  lf_compositor_drop_request(self);
}
