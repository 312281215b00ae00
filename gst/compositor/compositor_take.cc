// SPDX-License-Identifier: LGPL-2.1-or-later
//
// What nodes answer, up to the sum: which answer is of the request that has its turn, and what becomes of others.
#include <algorithm>
#include <utility>

#include "compositor/compositor_answer_pads.h"
#include "compositor/lfcompositor_private.h"

GST_DEBUG_CATEGORY_EXTERN(lf_compositor_debug);
#define GST_CAT_DEFAULT lf_compositor_debug

using lf::CompositorStats;

namespace {

enum class Taken {
  kDone,   // there is no more to it
  kLast,   // the same, and the node's answer to the current request is whole
  kAhead,  // it is of a later request
};

}  // namespace

static void refuse_rig(LfCompositor* self, const lf::wire::AnswerHeader& answer) {
  auto& state = *self->state;
  state.stats.count(CompositorStats::kRigMismatches);
  if (!std::exchange(state.warned_rig, true))
    GST_ELEMENT_WARNING(self, STREAM, FAILED,
                        ("Node %u answers for another rig: its fragments are not composed.", answer.node),
                        ("view %u, request %u", answer.view_id, answer.sequence));
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
    case lf::Assembly::Verdict::kOtherRig: refuse_rig(self, *answer); break;
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

// Live, an answer to what nobody has asked is thrown away: one far ahead, or with another time than its request has, is
// of a viewer that has begun anew since, or forged. Files have no such times, and wait for every answer.
static bool is_stray(LfCompositor* self, const lf::wire::AnswerHeader& answer, int32_t ahead) {
  if (!self->state->live) return false;
  return ahead > lf::AheadAnswers::kMostRequests ||
         (ahead == 0 && answer.target_time != self->state->current->target_time);
}

static Taken take_fragments(LfCompositor* self, NodeInput& node, GstBuffer* buffer) {
  auto& state = *self->state;
  std::string reason;
  const std::optional<lf::wire::AnswerPartHeader> answer = lf::parse_answer_buffer_header(buffer, &reason);
  if (!answer) {
    GST_WARNING_OBJECT(self, "dropped an answer: %s", reason.c_str());
    state.stats.count(CompositorStats::kBadAnswers);
    return Taken::kDone;
  }
  if (answer->view_id != state.current->view_id) return Taken::kDone;
  // Sequence numbers wrap: the sign of the difference tells the order.
  const auto ahead = static_cast<int32_t>(answer->sequence - state.current->sequence);
  if (is_stray(self, *answer, ahead)) {
    state.stats.count(CompositorStats::kStrayAnswers);
  } else if (ahead > 0) {
    return Taken::kAhead;
  } else if (ahead < 0) {
    note_late_answer(self, *answer, node);
  } else if (!node.parts.add(answer->part)) {
    state.stats.count(CompositorStats::kRepeatedAnswers);
  } else {
    add_answer(self, buffer);
    if (node.parts.complete() && answer->last_of_node) return Taken::kLast;
    if (node.parts.complete()) node.parts.clear();  // another answer follows
  }
  return Taken::kDone;
}

static Taken take_unit(LfCompositor* self, NodeInput& node, GstBuffer* buffer) {
  if (!lf::is_moments_buffer(buffer)) return take_fragments(self, node, buffer);
  const int32_t ahead = lf_compositor_take_moments(self, buffer);
  const bool stray = ahead > lf::AheadAnswers::kMostRequests && self->state->live;
  if (stray) self->state->stats.count(CompositorStats::kStrayAnswers);
  return ahead > 0 && !stray ? Taken::kAhead : Taken::kDone;
}

// Of a unit that take_unit() has found to be ahead: all units of an answer stream have it in the same place.
static uint32_t sequence_of(GstBuffer* unit) {
  constexpr gsize kAt = 16;
  guint8 bytes[4] = {};
  gst_buffer_extract(unit, kAt, bytes, sizeof bytes);
  return GST_READ_UINT32_BE(bytes);
}

// What came before this request had its turn.
static void take_early_answers(LfCompositor* self, NodeInput& node) {
  if (node.ahead.size() == 0) return;
  for (GstBuffer* buffer : node.ahead.take(self->state->current->sequence)) {
    const std::unique_ptr<GstBuffer, decltype([](GstBuffer* b) { gst_buffer_unref(b); })> owned(buffer);
    if (node.head != NodeInput::Head::kDone && take_unit(self, node, buffer) == Taken::kLast)
      node.head = NodeInput::Head::kDone;
  }
}

void lf_compositor_take_answers(LfCompositor* self, GstAggregatorPad* pad) {
  NodeInput& node = lf_compositor_node_of(pad);
  if (node.flushed.exchange(false)) {
    node.seen = nullptr;
    node.ahead.clear();
    if (node.head != NodeInput::Head::kDone) node.head = NodeInput::Head::kUnseen;
  }
  take_early_answers(self, node);
  if (node.head == NodeInput::Head::kDone) return;
  while (GstBuffer* buffer = gst_aggregator_pad_peek_buffer(pad)) {
    gst_buffer_unref(buffer);  // the pad keeps it
    if (buffer == node.seen) return;
    const Taken taken = take_unit(self, node, buffer);
    if (taken == Taken::kDone) {
      gst_aggregator_pad_drop_buffer(pad);
      continue;
    }
    node.head = taken == Taken::kLast ? NodeInput::Head::kDone : NodeInput::Head::kAhead;
    const bool aside = taken == Taken::kAhead && self->state->live && node.ahead.has_room(gst_buffer_get_size(buffer));
    node.seen = aside ? nullptr : buffer;
    if (!aside) return;
    if (GstBuffer* popped = gst_aggregator_pad_pop_buffer(pad)) node.ahead.keep(sequence_of(popped), popped);
  }
}

void lf_compositor_note_sequence(LfCompositor* self, uint32_t sequence) {
  auto& state = *self->state;
  const std::optional<uint32_t> last = std::exchange(state.last_sequence, sequence);
  if (!last || static_cast<int32_t>(sequence - *last) >= 0) return;
  GST_INFO_OBJECT(self, "requests go on at %u after %u: their viewer has begun anew", sequence, *last);
  state.past.clear();
  state.skipped.clear();
  for (GstAggregatorPad* pad : AnswerPads(self)) lf_compositor_node_of(pad).ahead.clear();
}
