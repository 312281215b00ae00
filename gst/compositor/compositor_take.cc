// SPDX-License-Identifier: LGPL-2.1-or-later
//
// What nodes answer, up to the sum: which answer is of the request that has its turn, and what becomes of others.
#include <utility>

#include "compositor/lfcompositor_private.h"

using lf::CompositorStats;
using Taken = lf::NodeInput::Taken;

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
  const std::shared_ptr<lf::gl::CardSum> card_sum = lf::card_sum_of(buffer);
  const auto mapped = std::make_shared<const lf::MappedBuffer>(buffer, lf::MappedBuffer::Part::kHead);
  std::string reason;
  std::optional<lf::wire::AnswerView> answer;
  if (!card_sum)
    answer = lf::wire::parse_answer(mapped->bytes(), &reason);
  else if (const auto head = lf::wire::parse_answer_header(mapped->bytes(), &reason))
    answer = lf::wire::AnswerView{*head, {}};
  if (!answer) {
    GST_WARNING_OBJECT(self, "dropped an answer: %s", reason.c_str());
    state.stats.count(CompositorStats::kBadAnswers);
    return;
  }
  const int64_t begun = g_get_monotonic_time();
  state.bytes += gst_buffer_get_size(buffer);
  const unsigned damaged_before = state.assembly.damaged();
  switch (card_sum ? state.assembly.add_on_card(*answer, card_sum) : state.assembly.add(*answer, mapped)) {
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

// An answer to a request before the current one: too late for its picture, but a sign of life all the same if it was
// there before the deadline and nobody waited for this node.
static void note_late_answer(LfCompositor* self, const lf::wire::AnswerPartHeader& answer, lf::NodeInput& node) {
  auto& state = *self->state;
  const lf::PastRequests::Answer late = state.past.judge(answer.sequence, lf_compositor_clock_time(self));
  if (late == lf::PastRequests::Answer::kToSkipped) return;
  state.stats.count(CompositorStats::kLateAnswers);
  if (late != lf::PastRequests::Answer::kInTime) return;
  node.was_in_time();
  lf::CameraRanges seeing = answer.cameras;
  seeing.remove(answer.blind);
  state.health.seen_late(answer.rig_hash, seeing);
}

// Live, an answer to what nobody has asked is thrown away: one far ahead, or with another time than its request has, is
// of a viewer that has begun anew since, or forged. Files have no such times, and wait for every answer.
static bool is_stray(LfCompositor* self, const lf::wire::AnswerHeader& answer, int32_t ahead) {
  if (!self->state->live) return false;
  return ahead > lf::AheadAnswers::kMostRequests ||
         (ahead == 0 && answer.target_time != self->state->current->target_time);
}

static Taken take_fragments(LfCompositor* self, lf::NodeInput& node, GstBuffer* buffer) {
  auto& state = *self->state;
  std::string reason;
  const std::optional<lf::wire::AnswerPartHeader> answer = lf::parse_answer_buffer_header(buffer, &reason);
  if (!answer) {
    GST_WARNING_OBJECT(self, "dropped an answer: %s", reason.c_str());
    state.stats.count(CompositorStats::kBadAnswers);
    return Taken::kDone;
  }
  if (answer->view_id != state.current->view_id) return Taken::kDone;
  if (state.assembly.is_beyond_rig(*answer)) {
    GST_WARNING_OBJECT(self, "node %u: speaks for cameras that the rig does not have", answer->node);
    state.stats.count(CompositorStats::kBadAnswers);
    return Taken::kDone;
  }
  // Sequence numbers wrap: the sign of the difference tells the order.
  const auto ahead = static_cast<int32_t>(answer->sequence - state.current->sequence);
  if (is_stray(self, *answer, ahead)) {
    state.stats.count(CompositorStats::kStrayAnswers);
  } else if (ahead > 0) {
    return Taken::kAhead;
  } else if (ahead < 0) {
    note_late_answer(self, *answer, node);
  } else if (!node.add_part(answer->part)) {
    state.stats.count(CompositorStats::kRepeatedAnswers);
  } else {
    add_answer(self, buffer);
    return node.part_added(answer->last_of_node);
  }
  return Taken::kDone;
}

static Taken take_moments(LfCompositor* self, GstBuffer* buffer) {
  auto& state = *self->state;
  const lf::MappedBuffer mapped(buffer);
  const lf::FocusFinder::Taken taken = state.focus.take(mapped.bytes(), *state.current);
  if (!taken.problem.empty()) {
    GST_WARNING_OBJECT(self, "dropped moments: %s", taken.problem.c_str());
    state.stats.count(CompositorStats::kBadAnswers);
  }
  const bool stray = taken.ahead > lf::AheadAnswers::kMostRequests && state.live;
  if (stray) state.stats.count(CompositorStats::kStrayAnswers);
  return taken.ahead > 0 && !stray ? Taken::kAhead : Taken::kDone;
}

void lf_compositor_take_answers(LfCompositor* self, lf::NodeInput& node) {
  auto& state = *self->state;
  node.take(state.current->sequence, state.live, [&](GstBuffer* buffer) {
    return lf::is_moments_buffer(buffer) ? take_moments(self, buffer) : take_fragments(self, node, buffer);
  });
}
