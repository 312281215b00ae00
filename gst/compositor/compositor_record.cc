// SPDX-License-Identifier: LGPL-2.1-or-later
// What a picture that is put out says of itself, and what stands in for it.
#include "compositor/lfcompositor_private.h"
#include "render/contribution_map.h"

using lf::CompositorStats;

// Pictures have the stamps of their requests, in the requests' segment.
void lf_compositor_follow_segment(LfCompositor* self) {
  auto& state = *self->state;
  const GstSegment& requests = GST_AGGREGATOR_PAD(self->request)->segment;
  if (requests.format != GST_FORMAT_TIME || gst_segment_is_equal(&requests, &state.segment)) return;
  state.segment = requests;
  gst_aggregator_update_segment(GST_AGGREGATOR(self), &requests);
}

// A picture that is shown again has its own already.
void lf_compositor_note_capture_time(GstBuffer* picture, uint64_t captured) {
  static GstStaticCaps static_caps = GST_STATIC_CAPS(LF_CAPTURE_TIME_CAPS);
  GstCaps* reference = gst_static_caps_get(&static_caps);
  if (captured != lf::kNoTime && !gst_buffer_get_reference_timestamp_meta(picture, reference))
    gst_buffer_add_reference_timestamp_meta(picture, reference, captured, GST_CLOCK_TIME_NONE);
  gst_caps_unref(reference);
}

// What is put out in place of an incomplete picture; takes it.
GstBuffer* lf_compositor_replace_incomplete(LfCompositor* self, GstBuffer* picture) {
  auto& state = *self->state;
  const uint64_t rig = state.assembly.fragments() > 0 ? state.assembly.rig_hash() : state.last_rig;
  if (self->partial || lf_compositor_is_complete(self)) {
    state.last_rig = rig;
    return picture;
  }
  GST_OBJECT_LOCK(self);
  const LfCompositorIncomplete options = self->incomplete;
  GST_OBJECT_UNLOCK(self);
  if (options == LF_COMPOSITOR_INCOMPLETE_REPEAT && state.last_picture) {
    state.stats.count(CompositorStats::kRepeatedPictures);
    gst_buffer_unref(picture);
    return gst_buffer_copy(state.last_picture);
  }
  if (options != LF_COMPOSITOR_INCOMPLETE_DROP) {
    state.last_rig = rig;
    return picture;
  }
  state.stats.count(CompositorStats::kDroppedPictures);
  gst_buffer_unref(picture);
  return nullptr;
}

void lf_compositor_record_skipped(LfCompositor* self, const lf::QosWatch::Late& late) {
  constexpr gint kFullQuality = 1'000'000;  // of what is shown at all
  auto& state = *self->state;
  state.stats.request_skipped(state.current->sequence);
  GstBuffer* request = gst_aggregator_pad_peek_buffer(GST_AGGREGATOR_PAD(self->request));
  if (!request) return;
  const GstSegment& segment = GST_AGGREGATOR_PAD(self->request)->segment;
  const GstClockTime pts = GST_BUFFER_PTS(request);
  GstMessage* message = gst_message_new_qos(
      GST_OBJECT(self), lf_compositor_is_live(self), gst_segment_to_running_time(&segment, GST_FORMAT_TIME, pts),
      gst_segment_to_stream_time(&segment, GST_FORMAT_TIME, pts), pts, GST_BUFFER_DURATION(request));
  gst_buffer_unref(request);
  const CompositorStats::Totals totals = state.stats.totals();
  gst_message_set_qos_values(message, late.jitter, late.proportion, kFullQuality);
  gst_message_set_qos_stats(message, GST_FORMAT_BUFFERS, totals.pictures, totals.skipped);
  gst_element_post_message(GST_ELEMENT(self), message);
}

// How much of the view cameras can see. A view that moves is looked at now and then, or for each picture's message.
static double coverage(LfCompositor* self, bool exact) {
  constexpr int kRows = 12;
  constexpr int64_t kInterval = G_USEC_PER_SEC / 2;
  auto& state = *self->state;
  auto& known = state.coverage;
  if (!state.rig) return -1;
  const lf::ViewRequest& request = *state.current;
  const int64_t now = g_get_monotonic_time();
  const bool same = known.share >= 0 && known.view == request.view && known.out_of_service == request.out_of_service;
  if (same || (known.share >= 0 && !exact && now < known.known_at + kInterval)) return known.share;
  const lf::Mesh& mesh = known.mesh.get(*state.rig, request.out_of_service);
  known.share = lf::mean_coverage(*state.rig, lf::ViewPlan(*state.rig, mesh, request.view), kRows);
  known.view = request.view;
  known.out_of_service = request.out_of_service;
  known.known_at = now;
  return known.share;
}

void lf_compositor_record(LfCompositor* self, int64_t answered, GstClockTime pts) {
  auto& state = *self->state;
  GST_OBJECT_LOCK(self);
  const bool post = self->post_messages;
  GST_OBJECT_UNLOCK(self);
  const lf::Assembly& assembly = state.assembly;
  GstStructure* description =
      state.stats.record({state.current->view_id, state.current->sequence, pts, assembly.fragments(),
                          assembly.missing(), assembly.damaged(), coverage(self, post), state.current_bytes,
                          state.moment_bytes, assembly.skew(), answered, state.adding, g_get_monotonic_time()},
                         post);
  if (description) gst_element_post_message(GST_ELEMENT(self), gst_message_new_element(GST_OBJECT(self), description));
}
