// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/hold_event.h"
#include "common/in_process.h"
#include "common/picture_caps.h"
#include "common/view_feedback.h"
#include "compositor/lfcompositor_private.h"
#include "compositor/output_caps.h"

#define LF_PICTURE_FORMATS LF_VIDEO_CAPS("{ " LF_RGB_FORMATS ", I420, NV12 }")

namespace {

GstStaticPadTemplate sink_template =
    GST_STATIC_PAD_TEMPLATE("sink_%u", GST_PAD_SINK, GST_PAD_REQUEST, GST_STATIC_CAPS(LF_ANSWER_CAPS));
GstStaticPadTemplate request_template =
    GST_STATIC_PAD_TEMPLATE("request", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_REQUEST_CAPS));
GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS,
                                                            GST_STATIC_CAPS(LF_PICTURE_FORMATS "; " LF_ANSWER_CAPS));

GstAggregatorClass* parent_class() { return GST_AGGREGATOR_CLASS(g_type_class_peek(GST_TYPE_AGGREGATOR)); }

}  // namespace

// Whether all that comes in follows a seek of the requests: answers out of a file or a socket don't.
static bool is_seekable(LfCompositor* self) {
  std::vector<GstPad*> pads;
  lf::ObjectLock lock(self);
  for (GList* item = GST_ELEMENT(self)->sinkpads; item; item = item->next)
    pads.push_back(GST_PAD(gst_object_ref(item->data)));
  lock.unlock();
  gboolean all = TRUE;
  for (GstPad* pad : pads) {
    GstQuery* query = gst_query_new_seeking(GST_FORMAT_TIME);
    gboolean seekable = FALSE;
    if (all && gst_pad_peer_query(pad, query)) gst_query_parse_seeking(query, nullptr, &seekable, nullptr, nullptr);
    all = all && seekable;
    gst_query_unref(query);
    gst_object_unref(pad);
  }
  return all;
}

// While the element runs: answers or video, and of video the formats of the cameras, once these are known. Before, the
// template: applications may set `partial` after they have linked the pad.
static bool lf_compositor_answer_caps_query(LfCompositor* self, GstQuery* query) {
  if (!lf::is_running(GST_ELEMENT(self))) return false;
  const lf::SharedCaps caps =
      lf::share_caps(lf_compositor_settings(self).partial ? lf::unit_caps(LF_ANSWER_MEDIA_TYPE)
                                                          : lf::offered_caps(self->state->output.family()));
  GstCaps* filter = nullptr;
  gst_query_parse_caps(query, &filter);
  const lf::SharedCaps filtered =
      filter ? lf::share_caps(gst_caps_intersect_full(filter, caps.get(), GST_CAPS_INTERSECT_FIRST)) : caps;
  gst_query_set_caps_result(query, filtered.get());
  return true;
}

// Where the output is and how long it is the requests tell.
static gboolean lf_compositor_src_query(GstAggregator* agg, GstQuery* query) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  switch (GST_QUERY_TYPE(query)) {
    case GST_QUERY_SEEKING: {
      if (!gst_pad_peer_query(self->request, query)) return FALSE;
      GstFormat format = GST_FORMAT_UNDEFINED;
      gboolean seekable = FALSE;
      gint64 start = 0, stop = -1;
      gst_query_parse_seeking(query, &format, &seekable, &start, &stop);
      if (seekable && !is_seekable(self)) gst_query_set_seeking(query, format, FALSE, start, stop);
      return TRUE;
    }
    case GST_QUERY_DURATION: return gst_pad_peer_query(self->request, query);
    case GST_QUERY_POSITION: {
      GstFormat format = GST_FORMAT_UNDEFINED;
      gst_query_parse_position(query, &format, nullptr);
      if (format != GST_FORMAT_TIME) return FALSE;
      GST_OBJECT_LOCK(self);
      const GstSegment& segment = GST_AGGREGATOR_PAD(GST_AGGREGATOR_SRC_PAD(self))->segment;
      const guint64 position = gst_segment_to_stream_time(&segment, GST_FORMAT_TIME, segment.position);
      GST_OBJECT_UNLOCK(self);
      if (!GST_CLOCK_TIME_IS_VALID(position)) return FALSE;
      gst_query_set_position(query, format, static_cast<gint64>(position));
      return TRUE;
    }
    case GST_QUERY_CAPS: return lf_compositor_answer_caps_query(self, query) || parent_class()->src_query(agg, query);
    case GST_QUERY_CONTEXT:
      return self->state->output.own_card().answer(query) || parent_class()->src_query(agg, query);
    default: return parent_class()->src_query(agg, query);
  }
}

lf::SharedCaps lf_compositor_accepted_caps(LfCompositor* self) {
  GstPad* src = GST_AGGREGATOR_SRC_PAD(self);
  g_autoptr(GstCaps) video = gst_caps_from_string(LF_PICTURE_FORMATS);
  return lf::share_caps(gst_pad_peer_query_caps(src, video));
}

// All whose requests come here are sought, one after the other, and go on together. Takes the event.
static gboolean seek(LfCompositor* self, GstEvent* event) {
  GstSeekFlags flags{};
  gst_event_parse_seek(event, nullptr, nullptr, &flags, nullptr, nullptr, nullptr, nullptr);
  const guint32 seqnum = gst_event_get_seqnum(event);
  const bool flushes = flags & GST_SEEK_FLAG_FLUSH;
  if (flushes) gst_pad_push_event(self->request, lf::hold_event(true, seqnum));
  const gboolean done = parent_class()->src_event(GST_AGGREGATOR(self), event);
  if (flushes) gst_pad_push_event(self->request, lf::hold_event(false, seqnum));
  return done;
}

// What a viewer does concerns its own requests alone. (GstAggregator 1.22.0 drops navigation events.)
static gboolean lf_compositor_src_event(GstAggregator* agg, GstEvent* event) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  const GstStructure* structure = gst_event_get_structure(event);
  const bool is_navigation = GST_EVENT_TYPE(event) == GST_EVENT_NAVIGATION;
  const bool is_view = GST_EVENT_TYPE(event) == GST_EVENT_CUSTOM_UPSTREAM && structure &&
                       gst_structure_has_name(structure, "lightfield-view-request");
  // The base class flushes what is downstream and asks every pad: each has to lead to the requests.
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEEK && (lf::is_reverse_seek(event) || !is_seekable(self))) {
    gst_event_unref(event);
    return FALSE;
  }
  if (GST_EVENT_TYPE(event) == GST_EVENT_QOS) {
    const guint view_id = lf_compositor_view_id(self);
    if (lf::QosWatch::view_of(event).value_or(view_id) == view_id) {
      event = lf::QosWatch::name_view(event, view_id);
      self->state->qos.see(event, lf_compositor_is_live(self));  // before the nodes, whose answers then say nothing
    }
  }
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEEK) return seek(self, event);
  if (!is_navigation && !is_view) return parent_class()->src_event(agg, event);
  event = gst_event_make_writable(event);
  gst_structure_set(gst_event_writable_structure(event), LF_VIEW_ID_FIELD, G_TYPE_UINT, lf_compositor_view_id(self),
                    nullptr);
  return gst_pad_push_event(self->request, event);
}

// Events come here in the order of the data: at EOS of the requests all of them have been answered. That ends the
// output, whether or not the nodes ever end theirs (GstAggregator waits for all).
static gboolean lf_compositor_sink_event(GstAggregator* agg, GstAggregatorPad* pad, GstEvent* event) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  const bool of_requests = GST_PAD(pad) == self->request;
  const bool ended = of_requests && GST_EVENT_TYPE(event) == GST_EVENT_EOS;
  const guint32 seqnum = gst_event_get_seqnum(event);
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT_DONE && !of_requests) {
    gst_event_unref(event);  // said by the requests, behind the last picture
    return TRUE;
  }
  // Requests may come at another rate: output caps name it.
  if (GST_EVENT_TYPE(event) == GST_EVENT_CAPS && of_requests) gst_pad_mark_reconfigure(GST_AGGREGATOR_SRC_PAD(agg));
  if (GST_EVENT_TYPE(event) == GST_EVENT_FLUSH_STOP && of_requests) {
    self->state->qos.clear();
    self->state->request_flushed = true;
  } else if (GST_EVENT_TYPE(event) == GST_EVENT_FLUSH_STOP) {
    lf::NodeInput::of(pad).flushed();
  }
  // Whoever writes a file would have an empty one, and be told that all went well.
  const uint64_t refused = self->guard->refused();
  if (ended && refused > 0 && !self->state->output.has_begun() && !lf_compositor_is_live(self))
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS,
                      ("There is no picture: of all requests %" G_GUINT64_FORMAT
                       " were refused. A warning before says which of the limits (max-pixels, ...) they are beyond.",
                       refused),
                      (nullptr));
  const gboolean ok = parent_class()->sink_event(agg, pad, event);
  // Before the first picture the source pad has no segment to end yet.
  if (ended && self->state->output.has_begun()) {
    GstEvent* eos = gst_event_new_eos();
    gst_event_set_seqnum(eos, seqnum);
    gst_pad_push_event(GST_AGGREGATOR_SRC_PAD(agg), eos);
    self->state->over = true;
  }
  return ok;
}

static gboolean lf_compositor_sink_query(GstAggregator* agg, GstAggregatorPad* pad, GstQuery* query) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  if (lf::is_in_process_query(query)) {
    lf::answer_in_process_query(query, self->state->output.context().get());
    return TRUE;
  }
  if (guint view_id; lf::is_focus_query(query, &view_id)) {
    const lf::CompositorSettings settings = lf_compositor_settings(self);
    if (view_id != settings.view_id || settings.view_focus().mode == lf::FocusMode::kPlane) return FALSE;
    lf::set_focus_waits(query, self->state->output.is_pushing());
    return TRUE;
  }
  if (guint view_id; lf::is_picture_caps_query(query, &view_id)) {
    const lf::CompositorSettings settings = lf_compositor_settings(self);
    if (view_id != settings.view_id || settings.partial) return FALSE;
    lf::answer_picture_caps_query(query, lf_compositor_accepted_caps(self).get());
    return TRUE;
  }
  return parent_class()->sink_query(agg, pad, query);
}

// Most often a view-id that was forgotten.
static void note_other_view(LfCompositor* self, uint32_t other) {
  if (!self->state->silence.others_asked(g_get_monotonic_time())) return;
  GST_ELEMENT_WARNING(
      self, STREAM, FAILED,
      ("Nobody asks for view %u, of this compositor, but for view %u and perhaps others: is view-id right?",
       lf_compositor_view_id(self), other),
      (nullptr));
}

// What is of other views never gets as far as to the pads' queues: nobody would take it from there while no own request
// comes, and a full queue stops the other views behind the same tee.
static GstPadProbeReturn lf_compositor_request_arrives(GstPad*, GstPadProbeInfo* info, gpointer data) {
  LfCompositor* self = LF_COMPOSITOR(data);
  if (self->state->over) return GST_PAD_PROBE_DROP;
  const lf::MappedBuffer mapped(GST_PAD_PROBE_INFO_BUFFER(info));
  const std::optional<lf::wire::RequestPeek> peek = lf::wire::peek_request(mapped.bytes());
  if (!peek) return GST_PAD_PROBE_OK;  // counted where it is taken
  if (peek->head.view_id != lf_compositor_view_id(self)) {
    note_other_view(self, peek->head.view_id);
    return GST_PAD_PROBE_DROP;
  }
  self->state->silence.asked();
  if (lf::wire::access_of_type(peek->type).value_or(lf::Access::kSelf) != lf::Access::kSelf)
    return GST_PAD_PROBE_DROP;  // for cameras
  if (!self->guard->admits(GST_ELEMENT(self), mapped.bytes(), self->state->extent, self->state->live))
    return GST_PAD_PROBE_DROP;
  if (!peek->head.probe && !peek->head.rehearsal)
    self->state->stats.request_arrived(peek->head.sequence, g_get_monotonic_time());
  return GST_PAD_PROBE_OK;
}

// GstAggregator bounds what waits on a pad by time. Answers out of a file or a TCP stream have none: with a duration
// they have their share of it, too.
static GstBuffer* give_duration(GstBuffer* answer) {
  constexpr GstClockTime kShare = 10 * GST_MSECOND;
  answer = gst_buffer_make_writable(answer);
  GST_BUFFER_DURATION(answer) = kShare;
  return answer;
}

static GstPadProbeReturn lf_compositor_answer_arrives(GstPad* pad, GstPadProbeInfo* info, gpointer data) {
  if (LF_COMPOSITOR(data)->state->over) return GST_PAD_PROBE_DROP;
  GstBuffer* answer = GST_PAD_PROBE_INFO_BUFFER(info);
  const std::optional<uint32_t> view_id = lf::peek_answer_view(answer);
  if (view_id && *view_id != lf_compositor_view_id(LF_COMPOSITOR(data))) return GST_PAD_PROBE_DROP;
  LF_COMPOSITOR(data)->state->silence.answered();
  lf::NodeInput::of(GST_AGGREGATOR_PAD(pad)).silence().answered();
  if (!GST_BUFFER_PTS_IS_VALID(answer) && !GST_BUFFER_DTS_IS_VALID(answer)) info->data = give_duration(answer);
  return GST_PAD_PROBE_OK;
}

// GstAggregator's own would name every pad sink_N and keep no name that was asked for.
static GstAggregatorPad* lf_compositor_create_pad(GstAggregator* agg, GstPadTemplate* templ, const gchar* name,
                                                  const GstCaps*) {
  g_autofree gchar* pad_name = nullptr;
  if (name && g_str_has_prefix(name, "sink_")) {
    pad_name = g_strdup(name);
  } else {
    guint number = 0;
    do {
      g_free(pad_name);
      pad_name = g_strdup_printf("sink_%u", number++);
      GstPad* taken = gst_element_get_static_pad(GST_ELEMENT(agg), pad_name);
      if (!taken) break;
      gst_object_unref(taken);
    } while (true);
  }
  gpointer pad =
      g_object_new(GST_TYPE_AGGREGATOR_PAD, "name", pad_name, "direction", GST_PAD_SINK, "template", templ, nullptr);
  lf::NodeInput::attach(GST_AGGREGATOR_PAD(pad));
  lf::accept_unit_caps(GST_PAD(pad));
  gst_pad_add_probe(GST_PAD(pad), GST_PAD_PROBE_TYPE_BUFFER, lf::callback<lf_compositor_answer_arrives>, agg, nullptr);
  return GST_AGGREGATOR_PAD(pad);
}

static void lf_compositor_release_pad(GstElement* element, GstPad* pad) {
  lf::NodeInput::of(GST_AGGREGATOR_PAD(pad)).let_go();
  GST_ELEMENT_CLASS(parent_class())->release_pad(element, pad);
}

void lf_compositor_add_request_pad(LfCompositor* self) {
  GstPadTemplate* templ = gst_element_class_get_pad_template(GST_ELEMENT_GET_CLASS(self), "request");
  self->request = GST_PAD(
      g_object_new(GST_TYPE_AGGREGATOR_PAD, "name", "request", "direction", GST_PAD_SINK, "template", templ, nullptr));
  lf::accept_unit_caps(self->request);
  gst_pad_add_probe(self->request, GST_PAD_PROBE_TYPE_BUFFER, lf::callback<lf_compositor_request_arrives>, self,
                    nullptr);
  gst_element_add_pad(GST_ELEMENT(self), self->request);
}

void lf_compositor_install_pads(LfCompositorClass* klass) {
  GstAggregatorClass* aggregator_class = GST_AGGREGATOR_CLASS(klass);
  aggregator_class->src_event = lf::callback<lf_compositor_src_event>;
  aggregator_class->src_query = lf::callback<lf_compositor_src_query>;
  aggregator_class->sink_event = lf::callback<lf_compositor_sink_event>;
  aggregator_class->sink_query = lf::callback<lf_compositor_sink_query>;
  aggregator_class->create_new_pad = lf::callback<lf_compositor_create_pad>;
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->release_pad = lf::callback<lf_compositor_release_pad>;
  gst_element_class_add_static_pad_template_with_gtype(element_class, &sink_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_add_static_pad_template_with_gtype(element_class, &request_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_add_static_pad_template_with_gtype(element_class, &src_template, GST_TYPE_AGGREGATOR_PAD);
}
