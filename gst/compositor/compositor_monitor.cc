// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <iterator>

#include "common/view_feedback.h"
#include "compositor/lfcompositor_private.h"

GST_DEBUG_CATEGORY_EXTERN(lf_compositor_debug);
#define GST_CAT_DEFAULT lf_compositor_debug

// A turn of a camera is two probes beside one request: what it sees itself, and what the others predict. Both come back
// as requests of this view, and their answers as any other's, through whatever tree there is.

static constexpr guint kPatience = 30;  // requests after which probes, or their answers, have been lost

static void forget_probe(LfCompositor* self) {
  auto& monitor = self->state->monitor;
  monitor.asked.reset();
  monitor.seen.reset();
}

void lf_compositor_reset_monitor(LfCompositor* self) {
  auto& monitor = self->state->monitor;
  forget_probe(self);
  monitor.cameras.reset();
  monitor.rig = 0;
  monitor.requests = 0;
}

void lf_compositor_monitor(LfCompositor* self) {
  auto& state = *self->state;
  auto& monitor = state.monitor;
  GST_OBJECT_LOCK(self);
  const guint interval = self->monitor_interval;
  GST_OBJECT_UNLOCK(self);
  if (interval == 0 || !state.rig) return;
  if (!monitor.cameras || monitor.rig != state.rig->hash()) {
    lf_compositor_reset_monitor(self);
    monitor.cameras.emplace(*state.rig);
    monitor.rig = state.rig->hash();
  }
  if (++monitor.requests < (monitor.asked ? interval + kPatience : interval)) return;
  monitor.requests = 0;
  forget_probe(self);
  const lf::CameraSet& out = state.current->out_of_service;
  const std::optional<lf::CameraIndex> camera = monitor.cameras->next(out);
  if (!camera) return;
  lf::CameraSet without;
  std::ranges::set_union(out, monitor.cameras->suspected(), std::back_inserter(without));
  monitor.asked = lf::make_probe(*state.rig, *camera, lf::shown_view(*state.current), without);
  GST_DEBUG_OBJECT(self, "camera %u is left out", *camera);
  gst_pad_push_event(self->request,
                     lf::view_feedback_event({.view_id = state.current->view_id,
                                              .extra_requests = {monitor.asked->seen, monitor.asked->predicted}}));
}

static void tell_of_suspects(LfCompositor* self) {
  const auto& monitor = self->state->monitor;
  GST_INFO_OBJECT(self, "%zu cameras are suspect", monitor.cameras->suspects().size());
  GstStructure* structure =
      gst_structure_new("lightfield-suspects", "lf-view-id", G_TYPE_UINT, self->state->current->view_id, nullptr);
  lf::set_suspects(structure, "suspects", monitor.cameras->suspects());
  gst_element_post_message(GST_ELEMENT(self), gst_message_new_element(GST_OBJECT(self), structure));
}

// Whether a camera that should have a part in the current request had no picture of its time: that says nothing of how
// well cameras fit together.
static bool any_is_blind(LfCompositor* self) {
  const auto& state = *self->state;
  lf::CameraRanges blind = state.assembly.cameras();
  blind.remove(state.assembly.seeing());
  blind.remove(lf::CameraRanges(state.current->out_of_service));
  return !blind.empty();
}

void lf_compositor_take_probe(LfCompositor* self) {
  auto& state = *self->state;
  auto& monitor = state.monitor;
  const lf::ViewRequest& request = *state.current;
  if (!request.trials.empty()) {
    state.assembly.finish(lf::PixelFamily::kRgb, false);
    return lf_compositor_answer_sweep(self);
  }
  state.stats.add_monitor_bytes(state.current_bytes);
  if (!monitor.asked || request.view.pose != monitor.asked->seen.view.pose) return;  // of somebody else, or too late
  const bool of_itself = request.view == monitor.asked->seen.view;
  if (!of_itself && (request.view != monitor.asked->predicted.view || !monitor.seen)) return forget_probe(self);
  state.assembly.finish(lf::PixelFamily::kRgb, true);
  if (!lf_compositor_is_complete(self) || any_is_blind(self)) return forget_probe(self);
  lf::CoveredPicture picture = lf::covered_picture(state.assembly.picture());
  if (of_itself) {
    monitor.seen = std::move(picture);
    return;
  }
  const std::vector<lf::CameraMonitor::Suspect> before = monitor.cameras->suspects();
  monitor.cameras->take(monitor.asked->camera, lf::compare_prediction(picture, *monitor.seen));
  forget_probe(self);
  state.stats.set_monitor(*monitor.cameras);
  if (monitor.cameras->suspects() != before) tell_of_suspects(self);
}
