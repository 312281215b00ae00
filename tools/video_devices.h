// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

// A camera that is plugged in.
struct VideoDevice {
  std::string name;     // the name that people know the camera by
  std::string source;   // what a rig has as source: a URI, or elements
  bool stable = false;  // the source means the same camera after a restart, or what else has been plugged in
};

// What GstDeviceMonitor finds under Video/Source, by whatever provider (v4l2, libcamera, Aravis, ...), in the order of
// the sources' numbers, each once. Sources: of V4L2 the link in `by_path` to the device's port on this machine
// (v4l2:///dev/v4l/by-path/...), else /dev/video0, which changes; of others their element with the properties that name
// the device. Screens, and what makes no element, are left out. gst_init() comes first.
std::vector<VideoDevice> find_video_devices(const std::string& by_path = "/dev/v4l/by-path");
