// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bins/viewer_requests.h"

#include "base/error.h"
#include "bins/view_split.h"

namespace lf {

ViewerRequests::ViewerRequests(GstBin* bin, const HostPort& from, const Admission& admission) : bin_(bin) {
  try {
    GstPad* received = add_receiver(bin, from, "X-LIGHTFIELD-REQUEST", admission, "listen", &elements_);
    split_ = GST_ELEMENT(g_object_new(LF_TYPE_VIEW_SPLIT, "name", "listen_requests", nullptr));
    gst_bin_add(bin, split_);
    elements_.push_back(split_);
    GstPad* sink = gst_element_get_static_pad(split_, "sink");
    gst_pad_link(received, sink);
    gst_object_unref(sink);
    gst_object_unref(received);
  } catch (const Error&) {
    remove();
    throw;
  }
}

ViewerRequests::~ViewerRequests() { remove(); }

void ViewerRequests::remove() {
  for (GstElement* element : elements_) {
    gst_element_set_state(element, GST_STATE_NULL);
    gst_bin_remove(bin_, element);
  }
}

std::unique_ptr<RequestedPads> ViewerRequests::connect(ViewerChain& viewer) {
  constexpr guint kAtOnce = 16;  // what comes is not known: four sets of as many views, or one of 64
  viewer.make_room(kAtOnce);
  auto pads = std::make_unique<RequestedPads>();
  GstPad* out = lf_view_split_add_view(LF_VIEW_SPLIT(split_), viewer.view_id());
  if (out) pads->add(split_, GST_PAD(gst_object_ref(out)));
  GstPad* in = gst_element_request_pad_simple(viewer.view(), "sink");
  if (in) pads->add(viewer.view(), in);
  if (!out || !in || gst_pad_link(out, in) != GST_PAD_LINK_OK)
    throw Error("requests of other hosts can't be linked with a viewer");
  return pads;
}

}  // namespace lf
