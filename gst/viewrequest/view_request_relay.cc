// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <iterator>

#include "common/gst_wire.h"
#include "viewrequest/lfviewrequest_private.h"

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE(
    "sink", GST_PAD_SINK, GST_PAD_REQUEST, GST_STATIC_CAPS(LF_REQUEST_CAPS ", framerate = (fraction) [ 0/1, max ]"));

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
  const GstFlowReturn flow = self->state->relay.push(buffer, gst_base_src_is_live(GST_BASE_SRC(self)), &dropped);
  if (dropped) GST_WARNING_OBJECT(pad, "requests come faster than they leave: dropped the oldest");
  return flow;
}

static gboolean relay_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  LfViewRequest* self = LF_VIEW_REQUEST(parent);
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_CAPS: {
      GstCaps* caps = nullptr;
      gst_event_parse_caps(event, &caps);
      self->state->relay.set_caps(caps);
      break;
    }
    case GST_EVENT_EOS: self->state->relay.end(); break;
    case GST_EVENT_FLUSH_START: self->state->relay.set_flushing(true); break;
    case GST_EVENT_FLUSH_STOP: self->state->relay.set_flushing(false); break;
    default: break;
  }
  GST_LOG_OBJECT(pad, "%" GST_PTR_FORMAT, event);
  gst_event_unref(event);  // the source pad has a stream, a segment and caps of its own
  return TRUE;
}

static gboolean relay_activate(GstPad*, GstObject* parent, GstPadMode mode, gboolean active) {
  if (mode != GST_PAD_MODE_PUSH) return FALSE;
  LF_VIEW_REQUEST(parent)->state->relay.set_flushing(!active);
  return TRUE;
}

static GstPad* lf_view_request_new_pad(GstElement* element, GstPadTemplate* templ, const gchar*, const GstCaps*) {
  LfViewRequest* self = LF_VIEW_REQUEST(element);
  if (self->state->relay.is_on()) return nullptr;
  GstPad* pad = gst_pad_new_from_template(templ, "sink");
  lf::accept_unit_caps(pad);
  gst_pad_set_chain_function(pad, lf::callback<relay_chain>);
  gst_pad_set_event_function(pad, lf::callback<relay_event>);
  gst_pad_set_activatemode_function(pad, lf::callback<relay_activate>);
  self->state->relay.set_sink(pad);
  gst_element_add_pad(element, pad);
  return pad;
}

static void lf_view_request_release_pad(GstElement* element, GstPad* pad) {
  LfViewRequest* self = LF_VIEW_REQUEST(element);
  gst_pad_set_active(pad, FALSE);
  self->state->relay.set_sink(nullptr);
  self->state->relay.end();  // who waits for the next request
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
  if (!self->state->warned_commands && !self->state->stream->access())
    GST_ELEMENT_WARNING(self, STREAM, FAILED,
                        ("Commands for cameras end here: set the property \"access\" of this relay, in place of the "
                         "viewer's."),
                        (nullptr));
  self->state->warned_commands = true;
}

// What is added to a request on its way. Whether anything is.
static bool complete_request(LfViewRequest* self, lf::ViewRequest& request) {
  lf::ObjectLock lock(self);
  const lf::CameraSet own = self->state->stream->out_of_service();
  lock.unlock();
  lf::CameraSet all;
  std::ranges::set_union(request.out_of_service, own, std::back_inserter(all));
  all = self->state->out_of_service.with_announced(request.view_id, all);
  bool changed = std::exchange(request.out_of_service, all) != all;
  const lf::CameraAccess* access = self->state->stream->access();
  if (!access) return self->state->relayed_focus.apply(request) || changed;
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
    const GstFlowReturn flow = self->state->relay.pop(&buffer);
    if (flow != GST_FLOW_OK) return flow;
    g_autoptr(GstCaps) caps = self->state->relay.take_caps();
    lf::ObjectLock lock(self);
    const std::shared_ptr<const lf::Rig> rig = self->state->stream->rig();
    lock.unlock();
    if (caps) gst_base_src_set_caps(GST_BASE_SRC(self), caps);
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
