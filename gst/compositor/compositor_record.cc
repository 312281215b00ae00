// SPDX-License-Identifier: LGPL-2.1-or-later
//
// What is said of a picture that is put out, or left out.
#include <utility>

#include "base/number_text.h"
#include "compositor/lfcompositor_private.h"

using lf::CompositorStats;

// A picture that is shown again has its own already.
void lf_compositor_note_capture_time(GstBuffer* picture, uint64_t captured) {
  static GstStaticCaps static_caps = GST_STATIC_CAPS(LF_CAPTURE_TIME_CAPS);
  GstCaps* reference = gst_static_caps_get(&static_caps);
  if (captured != lf::kNoTime && !gst_buffer_get_reference_timestamp_meta(picture, reference))
    gst_buffer_add_reference_timestamp_meta(picture, reference, captured, GST_CLOCK_TIME_NONE);
  gst_caps_unref(reference);
}

void lf_compositor_record_skipped(LfCompositor* self, const lf::QosWatch::Late& late) {
  constexpr gint kFullQuality = 1'000'000;  // of what is shown at all
  auto& state = *self->state;
  state.stats.request_skipped(state.current->sequence);
  if (!state.current->place.leads()) return;  // of a set one message tells
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

// Somebody who asks for a view outside of the array gets black pictures, and should know why.
// `coverage`: less than 0 where the array is not known. That of cameras out of service is no matter of the view.
static void note_unseen(LfCompositor* self, double coverage) {
  auto& state = *self->state;
  if (coverage != 0 || !state.health.out_of_service().empty() || std::exchange(state.warned_unseen, true)) return;
  if (!state.current->out_of_service.empty()) {
    lf::ViewRequest with_all = *state.current;
    with_all.out_of_service.clear();
    if (lf::ViewCoverage().share(*state.rig, with_all, {}, true, g_get_monotonic_time()) > 0) {
      GST_ELEMENT_WARNING(
          self, STREAM, FAILED,
          ("No camera sees anything of view %u, because %zu of %zu cameras are out of service, among them "
           "all that see the view: is the viewer's property out-of-service right?",
           state.current->view_id, state.current->out_of_service.size(), state.rig->cameras.size()),
          (nullptr));
      return;
    }
  }
  const std::string across = lf::format_text("%.2f", state.extent.load());
  if (state.current->place.count() > 1) {
    GST_ELEMENT_WARNING(self, STREAM, FAILED,
                        ("No camera sees anything of some of the %d views of view %u: their eyes are outside of the "
                         "array, which is %s m across. A smaller eye-distance or view-cone keeps them inside.",
                         state.current->place.count(), state.current->view_id, across.c_str()),
                        (nullptr));
    return;
  }
  GST_ELEMENT_WARNING(self, STREAM, FAILED,
                      ("No camera sees anything of view %u: the eye, or all that it looks at, is outside of the array, "
                       "which is %s m across. Such pictures are counted as unseen in stats.",
                       state.current->view_id, across.c_str()),
                      (nullptr));
}

// Of cameras that the compositor knows nothing of nothing can be missing.
static lf::CameraSet cameras_without_picture(const _LfCompositor::State& state) {
  if (!state.rig) return state.assembly.blind().cameras();
  lf::CameraSet missing;
  for (lf::CameraIndex camera = 0; camera < state.rig->cameras.size(); camera++)
    if (!state.assembly.seeing().contains(camera)) missing.push_back(camera);
  return missing;
}

static void note_view(LfCompositor* self, const lf::NodeInputs& nodes, double coverage) {
  auto& state = *self->state;
  const lf::Assembly& assembly = state.assembly;
  lf::ViewFacts facts{.request = *state.current,
                      .capture_time = std::nullopt,
                      .coverage = coverage,
                      .fragments = assembly.fragments(),
                      .missing = assembly.missing(),
                      .damaged = assembly.damaged(),
                      .missing_cameras = cameras_without_picture(state),
                      .missing_nodes = {}};
  const uint64_t captured = lf_compositor_capture_time(self);
  if (captured != lf::kNoTime) facts.capture_time = captured;
  for (lf::NodeInput* node : nodes)
    if (!node->has_answered()) facts.missing_nodes.push_back(node->name());
  state.view_meta.add(std::move(facts));
}

uint64_t lf_compositor_capture_time(LfCompositor* self) {
  const auto& state = *self->state;
  return state.current->target_time != lf::kNoTime ? state.current->target_time : state.assembly.actual_time();
}

void lf_compositor_record(LfCompositor* self, const lf::NodeInputs& nodes, int64_t answered, GstClockTime pts) {
  auto& state = *self->state;
  const lf::ViewRequest& request = *state.current;
  const lf::Assembly& assembly = state.assembly;
  const bool post = state.settings.post_messages;
  // Views of a set differ, so that each of the first one is looked at.
  const uint32_t set = request.sequence - static_cast<uint32_t>(request.place.turn());
  if (!state.first_set) state.first_set = set;
  const bool exact = post || (request.place.count() > 1 && set == *state.first_set);
  const double coverage = state.rig ? state.coverage.share(*state.rig, request, state.health.out_of_service(), exact,
                                                           g_get_monotonic_time())
                                    : -1;
  GstStructure* description = state.stats.record(
      {request.view_id, request.sequence, pts, assembly.fragments(), assembly.missing(), assembly.damaged(), coverage,
       state.bytes, state.focus.bytes(), assembly.skew(), answered, state.adding, g_get_monotonic_time()},
      post);
  note_unseen(self, coverage);
  if (!state.settings.partial) note_view(self, nodes, coverage);
  if (description) gst_element_post_message(GST_ELEMENT(self), gst_message_new_element(GST_OBJECT(self), description));
}
