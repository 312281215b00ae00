// SPDX-License-Identifier: LGPL-2.1-or-later
#include "video_devices.h"

#include <gst/gst.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <set>

#include "base/natural_order.h"

namespace {

namespace fs = std::filesystem;

std::string text_in(GstDevice* device, std::initializer_list<const char*> fields) {
  std::string text;
  if (GstStructure* properties = gst_device_get_properties(device)) {
    for (const char* field : fields)
      if (const char* value = gst_structure_get_string(properties, field); value && text.empty()) text = value;
    gst_structure_free(properties);
  }
  return text;
}

// The link among those of ports that leads to the device; "" without one.
std::string port_of(const std::string& device, const std::string& by_path) {
  std::error_code error;
  const fs::path real = fs::canonical(device, error);
  if (error) return "";
  std::set<std::string> links;
  for (const fs::directory_entry& entry : fs::directory_iterator(by_path, error))
    if (fs::canonical(entry.path(), error) == real && !error) links.insert(entry.path().string());
  return links.empty() ? "" : *links.begin();  // one device may be named by USB 2 and USB 3
}

// A value as it stands in a line of elements.
std::string value_text(const GValue* value) {
  if (G_VALUE_HOLDS_STRING(value)) {
    g_autofree gchar* escaped = g_strescape(g_value_get_string(value), nullptr);
    return "\"" + std::string(escaped) + "\"";
  }
  g_autofree gchar* text = gst_value_serialize(value);
  return text ? text : "";
}

// The device's element with what is set otherwise than in one that is just made, as gst-device-monitor-1.0 prints it.
// "" where there is none.
std::string element_of(GstDevice* device) {
  GstElement* element = gst_device_create_element(device, nullptr);
  if (!element) return "";
  gst_object_ref_sink(element);
  std::string line;
  GstElementFactory* factory = gst_element_get_factory(element);
  GstElement* plain = factory ? gst_element_factory_create(factory, nullptr) : nullptr;
  if (plain) {
    gst_object_ref_sink(plain);
    line = GST_OBJECT_NAME(factory);
    guint count = 0;
    g_autofree GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(element), &count);
    for (guint i = 0; i < count; i++) {
      constexpr auto kBoth = G_PARAM_READWRITE;
      if ((specs[i]->flags & kBoth) != kBoth || g_str_equal(specs[i]->name, "name") ||
          g_str_equal(specs[i]->name, "parent"))
        continue;
      GValue set = G_VALUE_INIT, usual = G_VALUE_INIT;
      g_object_get_property(G_OBJECT(element), specs[i]->name, &set);
      g_object_get_property(G_OBJECT(plain), specs[i]->name, &usual);
      if (gst_value_compare(&set, &usual) != GST_VALUE_EQUAL &&
          !(G_VALUE_HOLDS_STRING(&set) && !g_value_get_string(&set)))
        if (const std::string text = value_text(&set); !text.empty())
          line += std::string(" ") + specs[i]->name + "=" + text;
      g_value_unset(&set);
      g_value_unset(&usual);
    }
    gst_object_unref(plain);
  }
  gst_object_unref(element);
  // One word would be the name of a file.
  return line.empty() || line.find('=') != std::string::npos ? line : line + " ! identity";
}

bool is_screen(GstDevice* device) {
  g_autofree gchar* kind = gst_device_get_device_class(device);
  return std::strstr(kind, "Screen") || std::strstr(kind, "Monitor");
}

}  // namespace

std::vector<VideoDevice> find_video_devices(const std::string& by_path) {
  std::vector<VideoDevice> devices;
  std::set<std::string> paths;  // several providers may know one device
  GstDeviceMonitor* monitor = gst_device_monitor_new();
  gst_device_monitor_add_filter(monitor, "Video/Source", nullptr);
  if (gst_device_monitor_start(monitor)) {
    GList* list = gst_device_monitor_get_devices(monitor);
    for (GList* item = list; item; item = item->next) {
      GstDevice* device = GST_DEVICE(item->data);
      if (is_screen(device)) continue;
      VideoDevice found;
      // v4l2src and PipeWire each have their own name for it.
      if (const std::string path = text_in(device, {"device.path", "api.v4l2.path"}); !path.empty()) {
        if (!paths.insert(path).second) continue;
        const std::string port = port_of(path, by_path);
        found.source = "v4l2://" + (port.empty() ? path : port);
        found.stable = !port.empty();
      } else {
        found.source = element_of(device);
        found.stable = found.source.find('=') != std::string::npos;
      }
      if (found.source.empty()) continue;
      g_autofree gchar* name = gst_device_get_display_name(device);
      found.name = name ? name : "";
      if (const std::string serial = text_in(device, {"device.serial", "serial", "device.serial-number"});
          !serial.empty())
        found.name += ", serial " + serial;
      devices.push_back(found);
    }
    g_list_free_full(list, gst_object_unref);
    gst_device_monitor_stop(monitor);
  }
  gst_object_unref(monitor);
  std::ranges::stable_sort(devices, lf::natural_less, &VideoDevice::source);
  devices.erase(
      std::unique(devices.begin(), devices.end(), [](const auto& a, const auto& b) { return a.source == b.source; }),
      devices.end());
  return devices;
}
