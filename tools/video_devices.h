// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

// A camera that is plugged in.
struct VideoDevice {
  std::string name;  // for people
  std::string uri;   // v4l2:///dev/video0
};

// What GstDeviceMonitor finds under Video/Source, in the order of their numbers, each once. Devices that no URI names
// (screens, cameras of other systems) are left out. gst_init() comes first.
std::vector<VideoDevice> find_video_devices();
