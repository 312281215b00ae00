// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <functional>

namespace lf {

// An element of GStreamer's that is in no bin: an application, a picture of the pipeline and `gst-launch-1.0 -v` see
// neither its properties nor its caps, which for SRTP have keys in them. It works in the thread that pushes.
class HiddenElement {
 public:
  // Takes the buffer.
  using OnBuffer = std::function<GstFlowReturn(GstBuffer*)>;
  using OnList = std::function<GstFlowReturn(GstBufferList*)>;

  // Takes the floating element and starts it. `sink` is a pad of its own or one to be requested; `src` is there once
  // that is. The caps are those of what is pushed. Throws Error if it does not start.
  HiddenElement(GstElement* element, const char* sink, const char* src, const char* caps, OnBuffer on_buffer,
                OnList on_list = nullptr);
  ~HiddenElement();
  HiddenElement(const HiddenElement&) = delete;
  HiddenElement& operator=(const HiddenElement&) = delete;

  GstElement* get() const { return element_; }  // borrowed
  // Take what is pushed.
  GstFlowReturn push(GstBuffer* buffer) { return gst_pad_push(in_, buffer); }
  GstFlowReturn push(GstBufferList* list) { return gst_pad_push_list(in_, list); }

 private:
  static GstFlowReturn chain(GstPad* pad, GstObject* parent, GstBuffer* buffer);
  static GstFlowReturn chain_list(GstPad* pad, GstObject* parent, GstBufferList* list);
  void close();

  GstElement* element_;
  OnBuffer on_buffer_;
  OnList on_list_;
  GstPad *in_, *out_;
};

}  // namespace lf
