// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <memory>
#include <vector>

#include "base/host_list.h"
#include "bins/rtp_link.h"
#include "bins/viewer_chain.h"
#include "common/requested_pads.h"

namespace lf {

// View requests of viewers on other hosts, which come in at one port by RTP: each viewer of a bin then relays those of
// its view, and makes none of its own. The elements are the bin's; they go with this, when all viewers have given their
// pads back. To be used by one thread at a time.
class ViewerRequests {
 public:
  // Throws Error if GStreamer's elements for that are not there.
  ViewerRequests(GstBin* bin, const HostPort& from, const Admission& admission);
  ~ViewerRequests();
  ViewerRequests(const ViewerRequests&) = delete;
  ViewerRequests& operator=(const ViewerRequests&) = delete;

  // Links the viewer, whose pads these are. Throws Error.
  std::unique_ptr<RequestedPads> connect(ViewerChain& viewer);

 private:
  void remove();

  GstBin* bin_;
  std::vector<GstElement*> elements_;
  GstElement* split_ = nullptr;
};

}  // namespace lf
