// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/hidden_element.h"

#include <string>
#include <utility>

#include "base/error.h"

namespace lf {

GstFlowReturn HiddenElement::chain(GstPad* pad, GstObject*, GstBuffer* buffer) {
  return static_cast<HiddenElement*>(gst_pad_get_element_private(pad))->on_buffer_(buffer);
}

GstFlowReturn HiddenElement::chain_list(GstPad* pad, GstObject*, GstBufferList* list) {
  return static_cast<HiddenElement*>(gst_pad_get_element_private(pad))->on_list_(list);
}

HiddenElement::HiddenElement(GstElement* element, const char* sink, const char* src, const char* caps,
                             OnBuffer on_buffer, OnList on_list)
    : element_(GST_ELEMENT(gst_object_ref_sink(element))),
      on_buffer_(std::move(on_buffer)),
      on_list_(std::move(on_list)),
      in_(gst_pad_new("in", GST_PAD_SRC)),
      out_(gst_pad_new("out", GST_PAD_SINK)) {
  gst_object_ref_sink(in_);
  gst_object_ref_sink(out_);
  gst_pad_set_element_private(out_, this);
  gst_pad_set_chain_function(out_, chain);
  if (on_list_) gst_pad_set_chain_list_function(out_, chain_list);
  gst_pad_set_active(in_, TRUE);
  gst_pad_set_active(out_, TRUE);
  GstPad* sink_pad = gst_element_get_static_pad(element_, sink);
  if (!sink_pad) sink_pad = gst_element_request_pad_simple(element_, sink);
  GstPad* src_pad = gst_element_get_static_pad(element_, src);
  const bool works = sink_pad && src_pad && gst_pad_link(in_, sink_pad) == GST_PAD_LINK_OK &&
                     gst_pad_link(src_pad, out_) == GST_PAD_LINK_OK &&
                     gst_element_set_state(element_, GST_STATE_PLAYING) != GST_STATE_CHANGE_FAILURE;
  gst_clear_object(&sink_pad);
  gst_clear_object(&src_pad);
  if (!works) {
    const std::string name = GST_OBJECT_NAME(element_);
    close();
    throw Error(name + " does not start");
  }
  gst_pad_push_event(in_, gst_event_new_stream_start("hidden"));
  GstCaps* fixed = gst_caps_from_string(caps);
  gst_pad_push_event(in_, gst_event_new_caps(fixed));
  gst_caps_unref(fixed);
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  gst_pad_push_event(in_, gst_event_new_segment(&segment));
}

HiddenElement::~HiddenElement() { close(); }

void HiddenElement::close() {
  gst_element_set_state(element_, GST_STATE_NULL);
  gst_pad_set_active(in_, FALSE);
  gst_pad_set_active(out_, FALSE);
  gst_object_unref(in_);
  gst_object_unref(out_);
  gst_object_unref(element_);
}

}  // namespace lf
