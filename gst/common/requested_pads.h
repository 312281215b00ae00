// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <memory>
#include <utility>
#include <vector>

namespace lf {

// Request pads of any elements, given back when this goes, in the order in which they came. Holds references, so that
// it may outlive the elements' bin.
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

  // Takes the reference to the pad.
  GstPad* add(GstElement* element, GstPad* pad) {
    pads_.emplace_back(GST_ELEMENT(gst_object_ref(element)), pad);
    return pad;
  }

 private:
  std::vector<std::pair<GstElement*, GstPad*>> pads_;
};

}  // namespace lf
