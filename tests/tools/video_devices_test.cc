// SPDX-License-Identifier: LGPL-2.1-or-later
#include "../../tools/video_devices.h"

#include <gst/gst.h>
#include <gtest/gtest.h>

// A provider with devices of several systems, out of order, stands for hardware.
namespace {

struct FakeDevice {
  GstDevice parent;
};
struct FakeDeviceClass {
  GstDeviceClass parent_class;
};
G_DEFINE_TYPE(FakeDevice, fake_device, GST_TYPE_DEVICE)
void fake_device_class_init(FakeDeviceClass*) {}
void fake_device_init(FakeDevice*) {}

struct FakeProvider {
  GstDeviceProvider parent;
};
struct FakeProviderClass {
  GstDeviceProviderClass parent_class;
};
G_DEFINE_TYPE(FakeProvider, fake_provider, GST_TYPE_DEVICE_PROVIDER)

GList* fake_probe(GstDeviceProvider*) {
  struct {
    const char* name;
    const char* device_class;
    const char* field;
    const char* path;
  } const devices[] = {
      {"ten", "Video/Source", "device.path", "/dev/video10"},
      {"two", "Video/Source", "device.path", "/dev/video2"},
      {"two again", "Video/Source", "api.v4l2.path", "/dev/video2"},
      {"zero", "Video/Source", "api.v4l2.path", "/dev/video0"},
      {"screen", "Video/Source", "display", ":0"},
      {"microphone", "Audio/Source", "device.path", "/dev/snd0"},
  };
  GList* list = nullptr;
  for (const auto& d : devices) {
    GstStructure* properties = gst_structure_new("properties", d.field, G_TYPE_STRING, d.path, nullptr);
    GstCaps* caps = gst_caps_new_empty_simple("video/x-raw");
    list = g_list_append(list, g_object_new(fake_device_get_type(), "display-name", d.name, "device-class",
                                            d.device_class, "caps", caps, "properties", properties, nullptr));
    gst_caps_unref(caps);
    gst_structure_free(properties);
  }
  return list;
}

void fake_provider_class_init(FakeProviderClass* klass) {
  klass->parent_class.probe = fake_probe;
  gst_device_provider_class_set_static_metadata(&klass->parent_class, "Fake", "Source/Video/Audio", "Fake", "none");
}
void fake_provider_init(FakeProvider*) {}

TEST(VideoDevices, AreFoundByNumberEachOnce) {
  gst_init(nullptr, nullptr);
  // Real cameras of the machine that runs the test must not get in.
  GList* providers = gst_device_provider_factory_list_get_device_providers(GST_RANK_NONE);
  for (GList* item = providers; item; item = item->next)
    gst_registry_remove_feature(gst_registry_get(), GST_PLUGIN_FEATURE(item->data));
  gst_plugin_feature_list_free(providers);
  gst_device_provider_register(nullptr, "fakeprovider", GST_RANK_PRIMARY, fake_provider_get_type());

  const std::vector<VideoDevice> devices = find_video_devices();
  ASSERT_EQ(devices.size(), 3u);
  EXPECT_EQ(devices[0].uri, "v4l2:///dev/video0");
  EXPECT_EQ(devices[0].name, "zero");
  EXPECT_EQ(devices[1].uri, "v4l2:///dev/video2");
  EXPECT_EQ(devices[2].uri, "v4l2:///dev/video10");
}

}  // namespace
