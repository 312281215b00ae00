// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>

#include "common/view_feedback.h"
#include "composite/assembly.h"
#include "compositor/lfcompositor_private.h"
#include "wire/moments_codec.h"

GST_DEBUG_CATEGORY_EXTERN(lf_compositor_debug);
#define GST_CAT_DEFAULT lf_compositor_debug

using lf::CompositorStats;

static constexpr guint kUnheardRest = 15;  // requests: a second or less

GType lf_compositor_focus_get_type(void) {
  static const GType type = [] {
    static const GEnumValue values[] = {
        {static_cast<gint>(lf::FocusMode::kPlane), "The viewer's focal plane", "plane"},
        {static_cast<gint>(lf::FocusMode::kSurface), "Every pixel on its own: trials with every request", "surface"},
        {static_cast<gint>(lf::FocusMode::kAuto), "The same with as many trials as the scene needs", "auto"},
        {0, nullptr, nullptr}};
    return g_enum_register_static("LfCompositorFocus", values);
  }();
  return type;
}

// Of the properties. `auto` is for arrays that are known. Under the object lock.
static lf::FocusControl::Settings lf_compositor_focus(LfCompositor* self) {
  lf::FocusControl::Settings focus = self->focus;
  if (focus.mode == lf::FocusMode::kAuto && !self->rig_path) focus.mode = lf::FocusMode::kPlane;
  return focus;
}

bool lf_compositor_finds_focus(LfCompositor* self) {
  GST_OBJECT_LOCK(self);
  const bool finds = lf_compositor_focus(self).mode != lf::FocusMode::kPlane && !self->partial;
  GST_OBJECT_UNLOCK(self);
  return finds;
}

void lf_compositor_forget_moments(LfCompositor* self) {
  self->state->answers = {};
  self->state->moment_bytes = 0;
}

// Sequence numbers wrap: the sign of the difference tells the order. Negative for another view's.
static int32_t ahead_of_current(LfCompositor* self, const lf::wire::MomentsHeader& header) {
  const lf::ViewRequest& request = *self->state->current;
  if (header.view_id != request.view_id) return -1;
  return static_cast<int32_t>(header.sequence - request.sequence);
}

int32_t lf_compositor_take_moments(LfCompositor* self, GstBuffer* buffer) {
  auto& state = *self->state;
  const lf::MappedBuffer mapped(buffer);
  std::string reason;
  const auto drop = [&] {
    GST_WARNING_OBJECT(self, "dropped moments: %s", reason.c_str());
    state.stats.count(CompositorStats::kBadAnswers);
  };
  const std::optional<lf::wire::MomentsHeader> header =
      lf::wire::parse_moments_header(mapped.bytes(), nullptr, &reason);
  if (!header) {
    drop();
    return -1;
  }
  const lf::ViewRequest& request = *state.current;
  const int32_t ahead = ahead_of_current(self, *header);
  if (ahead != 0) return ahead;
  reason = lf::add_moments(mapped.bytes(), *header, request, state.answers);
  if (reason.empty())
    state.moment_bytes += mapped.bytes().size();
  else
    drop();
  return 0;
}

std::vector<GstBuffer*> lf_compositor_make_moments(LfCompositor* self, guint node) {
  const auto& state = *self->state;
  const lf::ViewRequest& request = *state.current;
  lf::wire::MomentsHeader header{request.view_id, request.sequence, state.assembly.rig_hash(), node, {}};
  std::vector<GstBuffer*> units;
  if (!state.answers.moments.empty())
    units.push_back(lf::wrap_bytes(lf::wire::encode_moments(header, state.answers.moments)));
  header.gains = state.answers.gains;
  if (state.answers.brightness.columns > 0)
    units.push_back(lf::wrap_bytes(lf::wire::encode_moments(header, {&state.answers.brightness, 1})));
  return units;
}

void lf_compositor_find_focus(LfCompositor* self) {
  auto& state = *self->state;
  GST_OBJECT_LOCK(self);
  const lf::FocusControl::Settings settings = lf_compositor_focus(self);
  const bool gains = self->gains && settings.mode != lf::FocusMode::kPlane;
  GST_OBJECT_UNLOCK(self);
  // Nobody takes it, as where requests come from a file: asked again now and then.
  if (!state.current->view.focus.map && state.unheard > 0) {
    state.unheard--;
    return;
  }
  const bool was_finding = state.focus_settings.mode != lf::FocusMode::kPlane;
  if (settings.mode == lf::FocusMode::kPlane && !was_finding) return;
  if (settings != state.focus_settings) {
    state.focus_settings = settings;
    state.focus = lf::FocusControl(settings);
    state.focus_array.reset();
  }
  lf::ViewRequest request = *state.current;
  if (!state.focus_array) {
    // Without a rig any plane will do that stays where it is.
    if (state.rig)
      state.focus_array.emplace(*state.rig);
    else
      state.focus_array.emplace(lf::plane_through(request.view.pose.position, request.view.pose.forward()));
    if (settings.mode != lf::FocusMode::kPlane) request.view.focus.map = nullptr;
  }
  lf::FoundFocus found{.sequence = request.sequence,
                       .plan = state.focus.next(request, state.answers.moments, *state.focus_array)};
  state.stats.set_focus(state.focus.state(), state.moment_bytes);
  // Through a surface that is anywhere cameras differ for other reasons.
  found.gains = lf::next_gains(state.mean_turns, gains && state.focus.state().sure, !found.plan.trials.empty(),
                               state.answers.brightness, state.answers.gains, request.sequence);
  const bool heard = gst_pad_push_event(
      self->request, lf::view_feedback_event({.view_id = request.view_id, .focus = std::move(found)}));
  state.unheard = heard ? 0 : kUnheardRest;
}

void lf_compositor_answer_sweep(LfCompositor* self) {
  auto& state = *self->state;
  const lf::ViewRequest& sweep = *state.current;
  state.stats.set_focus(state.focus.state(), state.moment_bytes + state.current_bytes);
  if (!lf_compositor_is_complete(self)) return;  // what some of the cameras agree on may be anything
  lf::FoundFocus found{.sequence = sweep.sequence,
                       .plan = lf::FocusControl().next(sweep, state.answers.moments, sweep.view.focus.map->from),
                       .gains = sweep.gains};
  gst_pad_push_event(self->request, lf::view_feedback_event({.view_id = sweep.view_id, .focus = std::move(found)}));
}
