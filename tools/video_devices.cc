// SPDX-License-Identifier: LGPL-2.1-or-later
#include "video_devices.h"

#include <algorithm>
#include <cstring>

#include <gst/gst.h>

namespace {

// v4l2src and PipeWire each have their own name for it.
std::string device_path(GstDevice* device) {
  std::string path;
  if (GstStructure* properties = gst_device_get_properties(device)) {
    for (const char* field : {"device.path", "api.v4l2.path"})
      if (const char* value = gst_structure_get_string(properties, field); value && path.empty()) path = value;
    gst_structure_free(properties);
  }
  return path;
}

}  // namespace

std::vector<VideoDevice> find_video_devices() {
  std::vector<VideoDevice> devices;
  GstDeviceMonitor* monitor = gst_device_monitor_new();
  gst_device_monitor_add_filter(monitor, "Video/Source", nullptr);
  if (gst_device_monitor_start(monitor)) {
    GList* list = gst_device_monitor_get_devices(monitor);
    for (GList* item = list; item; item = item->next) {
      const std::string path = device_path(GST_DEVICE(item->data));
      if (path.empty()) continue;
      gchar* name = gst_device_get_display_name(GST_DEVICE(item->data));
      devices.push_back({name ? name : "", "v4l2://" + path});
      g_free(name);
    }
    g_list_free_full(list, gst_object_unref);
    gst_device_monitor_stop(monitor);
  }
  gst_object_unref(monitor);
  // video2 comes before video10; several providers may know one device.
  std::stable_sort(devices.begin(), devices.end(),
                   [](const auto& a, const auto& b) { return strverscmp(a.uri.c_str(), b.uri.c_str()) < 0; });
  devices.erase(
      std::unique(devices.begin(), devices.end(), [](const auto& a, const auto& b) { return a.uri == b.uri; }),
      devices.end());
  return devices;
}
