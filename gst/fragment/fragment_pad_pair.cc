// SPDX-License-Identifier: LGPL-2.1-or-later
#include "fragment/lffragment_private.h"

using lf::PadPtr;
using lf::Requester;

static PadPtr lf_fragment_other_pad(GstPad* pad) { return Requester::of(pad).pads.other(pad); }

static gboolean lf_fragment_pair_event(GstPad* pad, GstEvent* event) {
  const PadPtr other = lf_fragment_other_pad(pad);
  if (other) return gst_pad_push_event(other.get(), event);
  gst_event_unref(event);
  return FALSE;
}

static gboolean lf_fragment_pair_query(GstPad* pad, GstQuery* query) {
  const PadPtr other = lf_fragment_other_pad(pad);
  return other && gst_pad_peer_query(other.get(), query);
}

// Cameras that are not live end with the last requester.
static void lf_fragment_finish_if_all_ended(LfFragment* self) {
  lf::ObjectLock lock(self);
  bool any = false, all = true;
  for (Requester* requester : self->state->requesters) {
    any = any || requester->ended;
    all = all && (requester->ended || !gst_pad_is_linked(requester->pads.request().get()));
  }
  lock.unlock();
  using Mode = lf::CameraFrames::Mode;
  if (any && all) lf_fragment_change_mode(self, Mode::kRunning, Mode::kFinished);
}

static void lf_fragment_set_ended(LfFragment* self, Requester& requester, bool ended) {
  const lf::ObjectLock lock(self);
  requester.ended = ended;
}

static gboolean lf_fragment_request_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  LfFragment* self = LF_FRAGMENT(parent);
  Requester& requester = Requester::of(pad);
  if (gst_event_type_get_flags(GST_EVENT_TYPE(event)) & GST_EVENT_TYPE_SERIALIZED) requester.live_answers.drain();
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_CAPS: {
      GstCaps* caps = lf::unit_caps(LF_ANSWER_MEDIA_TYPE);
      gst_event_unref(event);
      event = gst_event_new_caps(caps);
      gst_caps_unref(caps);
      requester.compositor.note_change();
      break;
    }
    case GST_EVENT_SEGMENT:
      requester.place.begin(lf::live_latency(pad).has_value());
      requester.compositor.note_change();
      break;
    case GST_EVENT_EOS:
      lf_fragment_set_ended(self, requester, true);
      lf_fragment_finish_if_all_ended(self);
      break;
    // First downstream, so that nobody gets an answer for which nothing was waited.
    case GST_EVENT_FLUSH_START: {
      const gboolean ok = lf_fragment_pair_event(pad, event);
      requester.live_answers.begin_flush();
      requester.waiting.forget_dropped();
      self->state->node.cancel(requester.kept, true);
      return ok;
    }
    case GST_EVENT_FLUSH_STOP:
      lf_fragment_set_ended(self, requester, false);
      requester.place.flush();
      requester.qos.clear();
      requester.kept.maker.clear();
      requester.live_answers.end_flush();
      self->state->node.cancel(requester.kept, false);
      break;
    default: break;
  }
  return lf_fragment_pair_event(pad, event);
}

// Everything from downstream (QoS, navigation, latency) concerns the requester, never the cameras: what they take
// belongs to the capture, not to the request path.
static gboolean lf_fragment_src_event(GstPad* pad, GstObject*, GstEvent* event) {
  Requester& requester = Requester::of(pad);
  if (GST_EVENT_TYPE(event) == GST_EVENT_RECONFIGURE) requester.compositor.note_change();
  if (GST_EVENT_TYPE(event) == GST_EVENT_QOS) requester.qos.see(event, requester.place.is_live());
  return lf_fragment_pair_event(pad, event);
}

static gboolean lf_fragment_src_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  if (GST_QUERY_TYPE(query) == GST_QUERY_CAPS) return gst_pad_query_default(pad, parent, query);
  return lf_fragment_pair_query(pad, query);
}

static gboolean lf_fragment_request_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  switch (GST_QUERY_TYPE(query)) {
    case GST_QUERY_CAPS:
    case GST_QUERY_ACCEPT_CAPS: return gst_pad_query_default(pad, parent, query);
    case GST_QUERY_ALLOCATION: return FALSE;
    default: return lf_fragment_pair_query(pad, query);
  }
}

static gboolean lf_fragment_src_activate(GstPad* pad, GstObject*, GstPadMode mode, gboolean active) {
  if (mode != GST_PAD_MODE_PUSH) return FALSE;
  lf::LiveAnswers& answers = Requester::of(pad).live_answers;
  if (!active) return answers.stop(pad);
  answers.start();
  return TRUE;
}

static GstIterator* lf_fragment_internal_links(GstPad* pad, GstObject*) {
  const PadPtr other = lf_fragment_other_pad(pad);
  if (!other) return nullptr;
  GValue value = G_VALUE_INIT;
  g_value_init(&value, GST_TYPE_PAD);
  g_value_set_object(&value, other.get());
  GstIterator* iterator = gst_iterator_new_single(GST_TYPE_PAD, &value);
  g_value_unset(&value);
  return iterator;
}

GstPad* lf_fragment_pair_new(LfFragment* self, GstPadTemplate* request_template, const gchar* request_name,
                             GstPadTemplate* src_template, const gchar* src_name) {
  static const GQuark quark = g_quark_from_static_string("lf-fragment-pair");
  GstPad* request = gst_pad_new_from_template(request_template, request_name);
  GstPad* src = gst_pad_new_from_template(src_template, src_name);
  lf::ObjectLock lock(self);
  const auto requester =
      std::make_shared<Requester>(request, src, self->state->next_requester++, lf_fragment_workers(self));
  self->state->requesters.insert(requester.get());
  lock.unlock();
  lf::accept_unit_caps(request);
  gst_pad_set_chain_function(request, lf::callback<lf_fragment_request_chain>);
  gst_pad_set_event_function(request, lf::callback<lf_fragment_request_event>);
  gst_pad_set_query_function(request, lf::callback<lf_fragment_request_query>);
  gst_pad_set_event_function(src, lf::callback<lf_fragment_src_event>);
  gst_pad_set_activatemode_function(src, lf::callback<lf_fragment_src_activate>);
  gst_pad_set_query_function(src, lf::callback<lf_fragment_src_query>);
  for (GstPad* pad : {src, request}) {
    gst_pad_set_iterate_internal_links_function(pad, lf::callback<lf_fragment_internal_links>);
    gst_pad_set_element_private(pad, requester.get());
    g_object_set_qdata_full(G_OBJECT(pad), quark, new std::shared_ptr<Requester>(requester),
                            [](gpointer data) { delete static_cast<std::shared_ptr<Requester>*>(data); });
  }
  for (GstPad* pad : {src, request}) {
    if (lf::is_running(GST_ELEMENT(self))) gst_pad_set_active(pad, TRUE);
    gst_element_add_pad(GST_ELEMENT(self), pad);
  }
  return request;
}

void lf_fragment_pair_release(LfFragment* self, GstPad* request) {
  Requester& requester = Requester::of(request);
  const PadPtr src = requester.pads.src();
  GST_OBJECT_LOCK(self);
  self->state->requesters.erase(&requester);
  GST_OBJECT_UNLOCK(self);
  gst_pad_set_active(src.get(), FALSE);  // an answer made without waiting goes nowhere
  self->state->node.cancel(requester.kept, true);
  gst_pad_set_active(request, FALSE);
  self->state->guard.forget(requester.number);
  gst_element_remove_pad(GST_ELEMENT(self), src.get());
  gst_element_remove_pad(GST_ELEMENT(self), request);
  lf_fragment_finish_if_all_ended(self);
}

void lf_fragment_trim_memory(LfFragment* self) {
  constexpr gint64 kInterval = 10 * G_USEC_PER_SEC;
  const gint64 now = g_get_monotonic_time();
  const lf::ObjectLock lock(self);
  if (now < self->state->trimmed_at + kInterval) return;
  self->state->trimmed_at = now;
  for (Requester* requester : self->state->requesters) {
    requester->memory->trim();
    requester->kept.images->trim();
  }
}
