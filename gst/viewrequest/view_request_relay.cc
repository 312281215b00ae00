// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <iterator>

#include "common/gst_wire.h"
#include "viewrequest/lfviewrequest_private.h"

GST_DEBUG_CATEGORY_EXTERN(lf_view_request_debug);
#define GST_CAT_DEFAULT lf_view_request_debug

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE(
    "sink", GST_PAD_SINK, GST_PAD_REQUEST, GST_STATIC_CAPS(LF_REQUEST_CAPS ", framerate = (fraction) [ 0/1, max ]"));

bool lf_view_request_is_relay(LfViewRequest* self) {
  GST_OBJECT_LOCK(self);
  const bool relay = self->sink != nullptr;
  GST_OBJECT_UNLOCK(self);
  return relay;
}

// Owned by the caller: the pad may be released meanwhile.
static GstPad* relay_sink(LfViewRequest* self) {
  GST_OBJECT_LOCK(self);
  GstPad* sink = self->sink ? GST_PAD(gst_object_ref(self->sink)) : nullptr;
  GST_OBJECT_UNLOCK(self);
  return sink;
}

bool lf_view_request_push_upstream(LfViewRequest* self, GstEvent* event) {
  GstPad* sink = relay_sink(self);
  if (!sink) {
    gst_event_unref(event);
    return false;
  }
  const bool taken = gst_pad_push_event(sink, event);
  gst_object_unref(sink);
  return taken;
}

bool lf_view_request_relayed_latency(LfViewRequest* self, GstQuery* query) {
  GstPad* sink = relay_sink(self);
  const bool known = sink && gst_pad_peer_query(sink, query);
  gst_clear_object(&sink);
  return known;
}

static GstFlowReturn relay_chain(GstPad* pad, GstObject* parent, GstBuffer* buffer) {
  LfViewRequest* self = LF_VIEW_REQUEST(parent);
  GstEvent* event = gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0);
  if (event) {
    const GstSegment* segment = nullptr;
    gst_event_parse_segment(event, &segment);
    buffer = gst_buffer_make_writable(buffer);
    if (segment->format == GST_FORMAT_TIME)
      GST_BUFFER_PTS(buffer) = gst_segment_to_running_time(segment, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
    gst_event_unref(event);
  }
  bool dropped = false;
  const GstFlowReturn flow = self->relay->push(buffer, gst_base_src_is_live(GST_BASE_SRC(self)), &dropped);
  if (dropped) GST_WARNING_OBJECT(pad, "requests come faster than they leave: dropped the oldest");
  return flow;
}

static gboolean relay_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  LfViewRequest* self = LF_VIEW_REQUEST(parent);
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_CAPS: {
      GstCaps* caps = nullptr;
      gst_event_parse_caps(event, &caps);
      GST_OBJECT_LOCK(self);
      gst_caps_replace(&self->relayed_caps, caps);
      self->relayed_caps = gst_caps_make_writable(self->relayed_caps);
      gst_caps_set_simple(self->relayed_caps, "parsed", G_TYPE_BOOLEAN, TRUE, nullptr);
      GST_OBJECT_UNLOCK(self);
      break;
    }
    case GST_EVENT_EOS: self->relay->end(); break;
    case GST_EVENT_FLUSH_START: self->relay->set_flushing(true); break;
    case GST_EVENT_FLUSH_STOP: self->relay->set_flushing(false); break;
    default: break;
  }
  GST_LOG_OBJECT(pad, "%" GST_PTR_FORMAT, event);
  gst_event_unref(event);  // the source pad has a stream, a segment and caps of its own
  return TRUE;
}

static gboolean relay_activate(GstPad*, GstObject* parent, GstPadMode mode, gboolean active) {
  if (mode != GST_PAD_MODE_PUSH) return FALSE;
  LF_VIEW_REQUEST(parent)->relay->set_flushing(!active);
  return TRUE;
}

static GstPad* lf_view_request_new_pad(GstElement* element, GstPadTemplate* templ, const gchar*, const GstCaps*) {
  LfViewRequest* self = LF_VIEW_REQUEST(element);
  if (lf_view_request_is_relay(self)) return nullptr;
  GstPad* pad = gst_pad_new_from_template(templ, "sink");
  lf::accept_unit_caps(pad);
  gst_pad_set_chain_function(pad, lf::callback<relay_chain>);
  gst_pad_set_event_function(pad, lf::callback<relay_event>);
  gst_pad_set_activatemode_function(pad, lf::callback<relay_activate>);
  GST_OBJECT_LOCK(self);
  self->sink = pad;
  GST_OBJECT_UNLOCK(self);
  gst_element_add_pad(element, pad);
  return pad;
}

static void lf_view_request_release_pad(GstElement* element, GstPad* pad) {
  LfViewRequest* self = LF_VIEW_REQUEST(element);
  gst_pad_set_active(pad, FALSE);
  GST_OBJECT_LOCK(self);
  self->sink = nullptr;
  GST_OBJECT_UNLOCK(self);
  self->relay->end();  // who waits for the next request
  gst_element_remove_pad(element, pad);
}

void lf_view_request_install_relay(GstElementClass* klass) {
  klass->request_new_pad = lf::callback<lf_view_request_new_pad>;
  klass->release_pad = lf::callback<lf_view_request_release_pad>;
  gst_element_class_add_static_pad_template(klass, &sink_template);
}

// Made for a mesh that may be another one here.
static void drop_command(LfViewRequest* self) {
  GST_LOG_OBJECT(self, "dropped a command");
  if (!self->warned_commands && !self->stream->access())
    GST_ELEMENT_WARNING(self, STREAM, FAILED,
                        ("Commands for cameras end here: set the property \"access\" of this relay, in place of the "
                         "viewer's."),
                        (nullptr));
  self->warned_commands = true;
}

bool lf_view_request_keep_focus(LfViewRequest* self, guint view_id, lf::FoundFocus focus) {
  if (!gst_base_src_is_live(GST_BASE_SRC(self))) return false;
  self->relayed_focus->announce(view_id, std::move(focus));
  return true;
}

// What is added to a request on its way. Whether anything is.
static bool complete_request(LfViewRequest* self, lf::ViewRequest& request) {
  lf::ObjectLock lock(self);
  const lf::CameraSet own = self->stream->out_of_service();
  lock.unlock();
  lf::CameraSet all;
  std::ranges::set_union(request.out_of_service, own, std::back_inserter(all));
  all = self->out_of_service->with_announced(request.view_id, all);
  bool changed = std::exchange(request.out_of_service, all) != all;
  const lf::CameraAccess* access = self->stream->access();
  if (!access) return self->relayed_focus->apply(request) || changed;
  const lf::Blending asked = request.view.blending;
  request.view.blending = access->blending(asked);
  // Cameras that are told where to look try no depths.
  request.trials.clear();
  request.gains = {};
  return std::exchange(request.view.focus.map, nullptr) || request.view.blending != asked || changed;
}

GstFlowReturn lf_view_request_relay(LfViewRequest* self, GstBuffer** out) {
  while (true) {
    g_autoptr(GstBuffer) buffer = nullptr;
    const GstFlowReturn flow = self->relay->pop(&buffer);
    if (flow != GST_FLOW_OK) return flow;
    lf::ObjectLock lock(self);
    GstCaps* caps = std::exchange(self->relayed_caps, nullptr);
    const std::shared_ptr<const lf::Rig> rig = self->stream->rig();
    lock.unlock();
    if (caps) {
      gst_base_src_set_caps(GST_BASE_SRC(self), caps);
      gst_caps_unref(caps);
    }
    std::string reason;
    const std::optional<lf::wire::AnyRequest> any = lf::decode_any_request_buffer(buffer, &reason);
    if (!any || lf::wire::access_of(*any) != lf::Access::kSelf) {
      if (any)
        drop_command(self);
      else
        GST_WARNING_OBJECT(self, "dropped a view request: %s", reason.c_str());
      continue;
    }
    lf::ViewRequest request = std::get<lf::ViewRequest>(*any);
    if (!complete_request(self, request)) {
      *out = g_steal_pointer(&buffer);
    } else {
      *out = lf::encode_request_buffer(request);
      gst_buffer_copy_into(*out, buffer, GST_BUFFER_COPY_TIMESTAMPS, 0, -1);
    }
    lf_view_request_send_more(self, request, rig, *out);
    return GST_FLOW_OK;
  }
}
