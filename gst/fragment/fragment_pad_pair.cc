// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/common.h"
#include "common/gst_wire.h"
#include "fragment/lffragment_private.h"

GST_DEBUG_CATEGORY_EXTERN(lf_fragment_debug);
#define GST_CAT_DEFAULT lf_fragment_debug

PadPair* lf_fragment_pad_pair_of(GstPad* pad) { return static_cast<PadPair*>(gst_pad_get_element_private(pad)); }

PadPtr lf_fragment_other_pad(GstPad* pad) {
  PadPair* pair = lf_fragment_pad_pair_of(pad);
  return GST_PAD_IS_SRC(pad) ? pair->request.get() : pair->src.get();
}

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

// The cameras end with the last requester.
static void lf_fragment_finish_if_all_ended(LfFragment* self) {
  GST_OBJECT_LOCK(self);
  bool any = false, all = self->mode == lf::CameraFrames::Mode::kRunning;
  for (PadPair* pair : *self->pairs) {
    any = any || pair->ended;
    all = all && (pair->ended || !gst_pad_is_linked(pair->request.get().get()));
  }
  GST_OBJECT_UNLOCK(self);
  if (any && all) lf_fragment_set_mode(self, lf::CameraFrames::Mode::kFinished);
}

static void lf_fragment_pair_ended(LfFragment* self, PadPair* pair) {
  GST_OBJECT_LOCK(self);
  pair->ended = true;
  GST_OBJECT_UNLOCK(self);
  lf_fragment_finish_if_all_ended(self);
}

static gboolean lf_fragment_request_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  LfFragment* self = LF_FRAGMENT(parent);
  PadPair* pair = lf_fragment_pad_pair_of(pad);
  if (gst_event_type_get_flags(GST_EVENT_TYPE(event)) & GST_EVENT_TYPE_SERIALIZED) pair->live_answers.drain();
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_CAPS: {
      GstCaps* caps = lf::unit_caps(LF_ANSWER_MEDIA_TYPE);
      gst_event_unref(event);
      event = gst_event_new_caps(caps);
      gst_caps_unref(caps);
      pair->downstream_is_new = true;
      break;
    }
    case GST_EVENT_SEGMENT:
      pair->live = lf_fragment_upstream_is_live(pad);
      pair->downstream_is_new = true;
      break;
    case GST_EVENT_EOS: lf_fragment_pair_ended(self, pair); break;
    // First downstream, so that nobody gets an answer for which nothing was waited.
    case GST_EVENT_FLUSH_START: {
      const gboolean ok = lf_fragment_pair_event(pad, event);
      pair->live_answers.clear();
      self->node->cancel(pair->requester, true);
      return ok;
    }
    case GST_EVENT_FLUSH_STOP:
      GST_OBJECT_LOCK(self);
      pair->ended = false;
      GST_OBJECT_UNLOCK(self);
      pair->flushed = true;
      pair->qos.clear();
      pair->requester.maker.clear();
      pair->view_requesters.clear();
      pair->live_flow = GST_FLOW_OK;
      self->node->cancel(pair->requester, false);
      break;
    default: break;
  }
  return lf_fragment_pair_event(pad, event);
}

// Everything from downstream (QoS, navigation, latency) concerns the requester, never the cameras: what they take
// belongs to the capture, not to the request path.
static gboolean lf_fragment_src_event(GstPad* pad, GstObject*, GstEvent* event) {
  PadPair* pair = lf_fragment_pad_pair_of(pad);
  if (GST_EVENT_TYPE(event) == GST_EVENT_RECONFIGURE) pair->downstream_is_new = true;
  if (GST_EVENT_TYPE(event) == GST_EVENT_QOS) pair->qos.see(event, pair->live);
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

// Live, a thread of the answer pad's answers; it begins with the first request.
static gboolean lf_fragment_src_activate(GstPad* pad, GstObject*, GstPadMode mode, gboolean active) {
  if (mode != GST_PAD_MODE_PUSH) return FALSE;
  PadPair* pair = lf_fragment_pad_pair_of(pad);
  if (active) {
    pair->live_flow = GST_FLOW_OK;
    pair->live_answers.start();
    return TRUE;
  }
  pair->live_answers.stop();
  const gboolean stopped = gst_pad_stop_task(pad);
  pair->view_requesters.clear();
  return stopped;
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
  const auto pair = std::make_shared<PadPair>(self, request, src);
  lf::accept_unit_caps(request);
  gst_pad_set_chain_function(request, lf::callback<lf_fragment_request_chain>);
  gst_pad_set_event_function(request, lf::callback<lf_fragment_request_event>);
  gst_pad_set_query_function(request, lf::callback<lf_fragment_request_query>);
  gst_pad_set_event_function(src, lf::callback<lf_fragment_src_event>);
  gst_pad_set_activatemode_function(src, lf::callback<lf_fragment_src_activate>);
  gst_pad_set_query_function(src, lf::callback<lf_fragment_src_query>);
  for (GstPad* pad : {src, request}) {
    gst_pad_set_iterate_internal_links_function(pad, lf::callback<lf_fragment_internal_links>);
    gst_pad_set_element_private(pad, pair.get());
    g_object_set_qdata_full(G_OBJECT(pad), quark, new std::shared_ptr<PadPair>(pair),
                            [](gpointer data) { delete static_cast<std::shared_ptr<PadPair>*>(data); });
  }
  lf::ObjectLock lock(self);
  self->pairs->insert(pair.get());
  pair->number = self->next_pair_number++;
  lock.unlock();
  for (GstPad* pad : {src, request}) {
    if (lf::is_running(GST_ELEMENT(self))) gst_pad_set_active(pad, TRUE);
    gst_element_add_pad(GST_ELEMENT(self), pad);
  }
  return request;
}

void lf_fragment_pair_release(LfFragment* self, GstPad* request) {
  PadPair* pair = lf_fragment_pad_pair_of(request);
  const PadPtr src = lf_fragment_other_pad(request);
  GST_OBJECT_LOCK(self);
  self->pairs->erase(pair);
  GST_OBJECT_UNLOCK(self);
  gst_pad_set_active(src.get(), FALSE);  // an answer made without waiting goes nowhere
  self->node->cancel(pair->requester, true);
  gst_pad_set_active(request, FALSE);
  self->guard->forget(pair->number);
  gst_element_remove_pad(GST_ELEMENT(self), src.get());
  gst_element_remove_pad(GST_ELEMENT(self), request);
  lf_fragment_finish_if_all_ended(self);
}
