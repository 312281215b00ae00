// SPDX-License-Identifier: LGPL-2.1-or-later
//
// What the view's lfviewrequest is told of its cameras and its focal surface, from what came of its requests.
#include "common/picture_caps.h"
#include "common/view_feedback.h"
#include "compositor/lfcompositor_private.h"

static bool tell(LfCompositor* self, const lf::ViewFeedback& feedback) {
  return gst_pad_push_event(self->request, lf::view_feedback_event(feedback));
}

static void post(LfCompositor* self, GstStructure* structure) {
  gst_element_post_message(GST_ELEMENT(self), gst_message_new_element(GST_OBJECT(self), structure));
}

void lf_compositor_announce_out_of_service(LfCompositor* self) {
  auto& state = *self->state;
  const lf::CameraSet& cameras = state.health.out_of_service();
  const size_t known = state.rig ? state.rig->cameras.size() : 0;
  const lf::CameraSet out = lf::out_of_mesh(cameras, state.corners, known);
  state.stats.set_out_of_service(cameras.size());
  const guint view_id = lf_compositor_view_id(self);
  GST_INFO_OBJECT(self, "%zu cameras are out of service", cameras.size());
  tell(self, {.view_id = view_id, .out_of_service = out});
  GstStructure* structure = gst_structure_new("lightfield-out-of-service", "view-id", G_TYPE_UINT, view_id, nullptr);
  lf::set_cameras(structure, "cameras", cameras);
  post(self, structure);
}

bool lf_compositor_tell_caps(LfCompositor* self) {
  if (lf_compositor_settings(self).partial) return false;
  const lf::SharedCaps accepted = lf_compositor_accepted_caps(self);
  return gst_pad_push_event(self->request, lf::picture_caps_event(lf_compositor_view_id(self), accepted.get()));
}

void lf_compositor_find_focus(LfCompositor* self) {
  auto& state = *self->state;
  lf::ViewRequest seen = *state.current;  // by the cameras that there are
  if (!state.gone.empty() && state.rig) {
    lf::CameraRanges out(lf::out_of_mesh(state.gone.cameras(), state.corners, state.rig->cameras.size()));
    out.add(lf::CameraRanges(seen.out_of_service));
    seen.out_of_service = out.cameras();
  }
  std::optional<lf::FoundFocus> found = state.focus.next(
      seen, state.settings.view_focus(), state.settings.match_gains(state.rig && state.rig->has_colour()));
  if (!found) return;
  state.stats.set_focus(state.focus.state(), state.focus.bytes());
  state.focus.heard(tell(self, {.view_id = state.current->view_id, .focus = std::move(found)}));
}

void lf_compositor_monitor(LfCompositor* self) {
  auto& state = *self->state;
  if (state.settings.monitor_interval == 0 || !state.rig) return;
  const auto probe = state.turns.next(*state.rig, *state.current, state.settings.monitor_interval);
  if (!probe) return;
  GST_DEBUG_OBJECT(self, "camera %u is left out", probe->camera);
  tell(self, {.view_id = state.current->view_id, .extra_requests = {probe->seen, probe->predicted}});
}

// Whether a camera that should have a part in the current request had no picture of its time: that says nothing of how
// well cameras fit together.
static bool any_is_blind(const _LfCompositor::State& state) {
  lf::CameraRanges blind = state.assembly.blind();
  blind.remove(lf::CameraRanges(state.current->out_of_service));
  blind.remove(lf::CameraRanges(state.health.out_of_service()));
  return !blind.empty();
}

static void answer_sweep(LfCompositor* self) {
  auto& state = *self->state;
  state.assembly.finish(lf::PixelFamily::kRgb, false);
  state.stats.set_focus(state.focus.state(), state.focus.bytes() + state.bytes);
  if (!state.assembly.complete()) return;  // what some of the cameras agree on may be anything
  tell(self, {.view_id = state.current->view_id, .focus = state.focus.sweep(*state.current)});
}

void lf_compositor_take_probe(LfCompositor* self) {
  auto& state = *self->state;
  const lf::ViewRequest& request = *state.current;
  if (!request.trials.empty()) return answer_sweep(self);
  state.stats.add_monitor_bytes(state.bytes);
  if (!state.turns.expects(request)) return;
  state.assembly.finish(lf::PixelFamily::kRgb, true);
  if (!state.assembly.complete() || any_is_blind(state)) return state.turns.lose();
  const auto came = state.turns.take(request, lf::covered_picture(state.assembly.picture()));
  if (came == lf::CameraTurns::Came::kHalf) return;
  const lf::CameraMonitor& monitor = *state.turns.monitor();
  state.stats.set_monitor(monitor);
  if (came != lf::CameraTurns::Came::kOtherSuspects) return;
  GST_INFO_OBJECT(self, "%zu cameras are suspect", monitor.suspects().size());
  GstStructure* structure = gst_structure_new("lightfield-suspects", "view-id", G_TYPE_UINT, request.view_id, nullptr);
  lf::set_suspects(structure, "suspects", monitor.suspects());
  post(self, structure);
}
