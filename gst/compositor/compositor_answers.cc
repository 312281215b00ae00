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

static void add_answer(LfCompositor* self, GstBuffer* buffer) {
  auto& state = *self->state;
  const auto mapped = std::make_shared<const lf::MappedBuffer>(buffer);
  std::string reason;
  const std::optional<lf::wire::AnswerView> answer = lf::wire::parse_answer(mapped->bytes(), &reason);
  if (!answer) {
    GST_WARNING_OBJECT(self, "dropped an answer: %s", reason.c_str());
    state.stats.count(CompositorStats::kBadAnswers);
    return;
  }
  const int64_t begun = g_get_monotonic_time();
  state.current_bytes += mapped->bytes().size();
  const unsigned damaged_before = state.assembly.damaged();
  switch (state.assembly.add(*answer, mapped)) {
    case lf::Assembly::Verdict::kOtherRig:
      state.stats.count(CompositorStats::kRigMismatches);
      if (!state.warned_rig)
        GST_ELEMENT_WARNING(self, STREAM, FAILED,
                            ("Node %u answers for another rig: its fragments are not composed.", answer->node),
                            ("view %u, request %u", answer->view_id, answer->sequence));
      state.warned_rig = true;
      break;
    case lf::Assembly::Verdict::kNeedsRig:
      state.stats.count(CompositorStats::kBadAnswers);
      if (!state.warned_rig)
        GST_ELEMENT_WARNING(
            self, RESOURCE, SETTINGS,
            ("Node %u answers with pixels of its cameras: set the property \"rig\" to compose them.", answer->node),
            ("view %u, request %u", answer->view_id, answer->sequence));
      state.warned_rig = true;
      break;
    case lf::Assembly::Verdict::kBadFragment:
      GST_WARNING_OBJECT(self, "node %u: fragments that don't fit the view or the other nodes'", answer->node);
      state.stats.count(CompositorStats::kBadAnswers);
      break;
    default: break;
  }
  state.adding += g_get_monotonic_time() - begun;
  if (const unsigned damaged = state.assembly.damaged() - damaged_before)
    GST_WARNING_OBJECT(self, "node %u: %u fragments are damaged", answer->node, damaged);
}

// An answer to a request that has been composed: too late for the picture, but in time all the same if nobody waited
// for this node.
static void note_late_answer(LfCompositor* self, const lf::wire::AnswerPartHeader& answer, NodeInput& node) {
  auto& state = *self->state;
  if (std::ranges::find(state.skipped, answer.sequence) != state.skipped.end()) return;
  state.stats.count(CompositorStats::kLateAnswers);
  const auto past = std::ranges::find(state.past, answer.sequence, &_LfCompositor::State::Past::sequence);
  if (past == state.past.end()) return;
  // Answers are looked at when there is a request. Of the one before it nobody knows since when it has been there:
  // where requests are as far apart as the deadline, a node that nobody waits for would never be in time again.
  const bool is_latest = answer.sequence == state.past.back().sequence;
  if (!is_latest && lf_compositor_clock_time(self) > past->deadline) return;
  node.missed = 0;
  if (state.health_rig != 0 && answer.rig_hash != state.health_rig) return;
  lf::CameraRanges seeing = answer.cameras;
  seeing.remove(answer.blind);
  state.seeing_since.add(seeing);
}

// Adds what has come from this node for the current request, up to its last part.
static void take_answers(LfCompositor* self, GstAggregatorPad* pad) {
  auto& state = *self->state;
  NodeInput& node = lf_compositor_node_of(pad);
  if (node.flushed.exchange(false)) {
    node.seen = nullptr;
    if (node.head != NodeInput::Head::kDone) node.head = NodeInput::Head::kUnseen;
  }
  if (node.head == NodeInput::Head::kDone) return;
  while (GstBuffer* buffer = gst_aggregator_pad_peek_buffer(pad)) {
    gst_buffer_unref(buffer);  // the pad keeps it
    if (buffer == node.seen) return;
    if (lf::is_moments_buffer(buffer)) {
      if (lf_compositor_take_moments(self, buffer) > 0) {
        node.head = NodeInput::Head::kAhead;
        node.seen = buffer;
        return;
      }
      gst_aggregator_pad_drop_buffer(pad);
      continue;
    }
    std::string reason;
    const std::optional<lf::wire::AnswerPartHeader> answer = lf::parse_answer_buffer_header(buffer, &reason);
    const bool own = answer && answer->view_id == state.current->view_id;
    // Sequence numbers wrap: the sign of the difference tells the order.
    const int32_t ahead = own ? static_cast<int32_t>(answer->sequence - state.current->sequence) : 0;
    if (!answer) {
      GST_WARNING_OBJECT(pad, "dropped an answer: %s", reason.c_str());
      state.stats.count(CompositorStats::kBadAnswers);
    } else if (own && ahead > 0) {
      node.head = NodeInput::Head::kAhead;
      node.seen = buffer;
      return;
    } else if (own && ahead < 0) {
      note_late_answer(self, *answer, node);
    } else if (own && !node.parts.add(answer->part)) {
      state.stats.count(CompositorStats::kRepeatedAnswers);
    } else if (own) {
      add_answer(self, buffer);
      if (node.parts.complete() && answer->last_of_node) {
        node.head = NodeInput::Head::kDone;
        node.seen = buffer;
        return;
      }
      if (node.parts.complete()) node.parts.clear();  // another answer follows
    }
    gst_aggregator_pad_drop_buffer(pad);
  }
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
  const AnswerPads pads(self);
  for (GstAggregatorPad* pad : pads) take_answers(self, pad);
  const bool live = lf_compositor_is_live(self);
  const bool all_answered =
      std::ranges::none_of(pads, [&](GstAggregatorPad* pad) { return is_awaited(self, pad, live); });
  const GstClockTime due = lf_compositor_deadline(self);
  const bool late = GST_CLOCK_TIME_IS_VALID(due) && lf_compositor_clock_time(self) >= due;
  return all_answered || late ? lf_compositor_finish_request(self, pads) : GST_AGGREGATOR_FLOW_NEED_DATA;
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
  const GstFlowReturn flow = lf::guarded(agg, GST_FLOW_ERROR, [self] { return compose(self); });
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
