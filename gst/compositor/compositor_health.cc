// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/view_feedback.h"
#include "compositor/lfcompositor_private.h"

GST_DEBUG_CATEGORY_EXTERN(lf_compositor_debug);
#define GST_CAT_DEFAULT lf_compositor_debug

void lf_compositor_reset_health(LfCompositor* self) {
  auto& state = *self->state;
  state.health = lf::CameraHealth(self->max_missed);
  if (state.rig && !self->partial) state.health.expect(state.rig->cameras.size());
  state.seeing_since = {};
}

void lf_compositor_use_rig_for_health(LfCompositor* self, uint64_t hash) {
  auto& state = *self->state;
  if (hash == 0 || hash == state.health_rig) return;
  const bool replaced = std::exchange(state.health_rig, hash) != 0;
  if (!replaced) return;
  const bool any = !state.health.out_of_service().empty();
  lf_compositor_reset_health(self);
  if (any) lf_compositor_announce_out_of_service(self);
}

void lf_compositor_announce_out_of_service(LfCompositor* self) {
  auto& state = *self->state;
  const lf::CameraSet& cameras = state.health.out_of_service();
  state.stats.set_out_of_service(cameras.size());
  const guint view_id = lf_compositor_view_id(self);
  GST_INFO_OBJECT(self, "%zu cameras are out of service", cameras.size());
  gst_pad_push_event(self->request, lf::view_feedback_event({.view_id = view_id, .out_of_service = cameras}));
  GstStructure* structure = gst_structure_new("lightfield-out-of-service", "lf-view-id", G_TYPE_UINT, view_id, nullptr);
  lf::set_cameras(structure, "cameras", cameras);
  gst_element_post_message(GST_ELEMENT(self), gst_message_new_element(GST_OBJECT(self), structure));
}
