// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <memory>
#include <vector>

#include "base/host_list.h"
#include "bins/viewer_chain.h"
#include "common/requested_pads.h"

namespace lf {

// The cameras that the viewers of a bin share: where their requests go and their answers come from. The elements are
// the bin's; they go with this, when all viewers have given their pads back. To be used by one thread at a time.
class ViewerCameras {
 public:
  virtual ~ViewerCameras() = default;
  // Links the viewer, whose pads these are. Throws Error.
  virtual std::unique_ptr<RequestedPads> connect(ViewerChain& viewer) = 0;
};

// The cameras of a rig that are on this machine: one lfcameranode, "node".
std::unique_ptr<ViewerCameras> cameras_here(GstBin* bin);
// Cameras on hosts that are reached by RTP. Throws Error if GStreamer's elements for that are not there.
// `key_file`: what they share; "" where packets are plain, and answers come from the addresses of these hosts.
std::unique_ptr<ViewerCameras> cameras_on_hosts(GstBin* bin, const std::vector<NodeAddress>& nodes,
                                                const std::string& key_file);

}  // namespace lf
