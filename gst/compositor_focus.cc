// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>

#include "focal_surface_event.h"
#include "focus/array_plane.h"
#include "lfcompositor_private.h"
#include "wire/moments_codec.h"

GST_DEBUG_CATEGORY_EXTERN(lf_compositor_debug);
#define GST_CAT_DEFAULT lf_compositor_debug

using lf::CompositorStats;

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

bool lf_compositor_finds_focus(LfCompositor* self) {
  GST_OBJECT_LOCK(self);
  const bool finds = self->focus.mode != lf::FocusMode::kPlane && !self->partial;
  GST_OBJECT_UNLOCK(self);
  return finds;
}

void lf_compositor_forget_moments(LfCompositor* self) {
  self->state->moments.clear();
  self->state->moment_bytes = 0;
}

int lf_compositor_take_moments(LfCompositor* self, GstBuffer* buffer) {
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
  if (header->view_id != request.view_id) return -1;
  // Sequence numbers wrap: the sign of the difference tells the order.
  const auto ahead = static_cast<int32_t>(header->sequence - request.sequence);
  if (ahead != 0) return ahead > 0 ? 1 : -1;
  lf::wire::MomentsShape asked;
  if (const lf::FocalMap* map = request.view.focus.map.get())
    asked = {map->columns, map->rows, request.trials.size()};
  std::optional<lf::wire::MomentsUnit> unit = lf::wire::decode_moments(mapped.bytes(), asked, &reason);
  if (unit && request.rig_hash != 0 && unit->rig_hash != request.rig_hash) {
    reason = "of another rig";
    unit.reset();
  }
  if (!unit) {
    drop();
    return 0;
  }
  state.moment_bytes += mapped.bytes().size();
  if (state.moments.empty())
    state.moments = std::move(unit->trials);
  else
    for (size_t i = 0; i < state.moments.size(); i++) state.moments[i].add(unit->trials[i]);
  return 0;
}

GstBuffer* lf_compositor_make_moments(LfCompositor* self, guint node) {
  const auto& state = *self->state;
  if (state.moments.empty()) return nullptr;
  const lf::ViewRequest& request = *state.current;
  return lf::wrap_bytes(lf::wire::encode_moments(
      {request.view_id, request.sequence, state.assembly.rig_hash(), node}, state.moments));
}

void lf_compositor_find_focus(LfCompositor* self) {
  auto& state = *self->state;
  GST_OBJECT_LOCK(self);
  const lf::FocusControl::Settings settings = self->focus;
  GST_OBJECT_UNLOCK(self);
  const bool was_finding = state.focus_settings.mode != lf::FocusMode::kPlane;
  if (settings != state.focus_settings) {
    state.focus_settings = settings;
    state.focus = lf::FocusControl(settings);
    state.focus_from.reset();
  }
  // A viewer may ask for the focus once, where none is looked for.
  if (settings.mode == lf::FocusMode::kPlane && !was_finding && state.moments.empty()) return;
  lf::ViewRequest request = *state.current;
  if (!state.focus_from) {
    // Without a rig any plane will do that stays where it is.
    state.focus_from = state.rig ? lf::array_plane(*state.rig)
                                 : lf::plane_through(request.view.pose.position, request.view.pose.forward());
    if (settings.mode != lf::FocusMode::kPlane) request.view.focus.map = nullptr;
  }
  const lf::FocusControl::Plan plan = state.focus.next(request, state.moments, *state.focus_from);
  state.stats.set_focus(state.focus.state(), state.moment_bytes);
  gst_pad_push_event(self->request, lf::focal_surface_event(request, plan));
}
