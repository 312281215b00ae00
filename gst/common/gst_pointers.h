// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include <gst/gst.h>

namespace lf {

struct UnrefBuffer {
  void operator()(GstBuffer* buffer) const { gst_buffer_unref(buffer); }
};
using BufferPtr = std::unique_ptr<GstBuffer, UnrefBuffer>;

struct UnrefElement {
  void operator()(GstElement* element) const { gst_object_unref(element); }
};
using ElementPtr = std::unique_ptr<GstElement, UnrefElement>;

struct UnrefPad {
  void operator()(GstPad* pad) const { gst_object_unref(pad); }
};
using PadPtr = std::unique_ptr<GstPad, UnrefPad>;

using SharedCaps = std::shared_ptr<GstCaps>;
inline SharedCaps share_caps(GstCaps* caps) {
  return caps ? SharedCaps(caps, [](GstCaps* owned) { gst_caps_unref(owned); }) : nullptr;
}

// Releases request pads in its destructor, in the order of add(). Holds references to the elements, so it may outlive
// their bin.
class RequestedPads {
 public:
  RequestedPads() = default;
  ~RequestedPads() {
    for (const auto& [element, pad] : pads_) {
      gst_element_release_request_pad(element, pad);
      gst_object_unref(pad);
      gst_object_unref(element);
    }
  }
  RequestedPads(const RequestedPads&) = delete;
  RequestedPads& operator=(const RequestedPads&) = delete;

  GstPad* add(GstElement* element, GstPad* pad) {
    pads_.emplace_back(GST_ELEMENT(gst_object_ref(element)), pad);
    return pad;
  }

 private:
  std::vector<std::pair<GstElement*, GstPad*>> pads_;
};

}  // namespace lf
