// SPDX-License-Identifier: LGPL-2.1-or-later
#include "../../tools/cameras/rig_cameras.h"

#include <gst/gst.h>

#include "support/temp_dir.h"
#include "support/test.h"

// A fake device provider with devices of several systems, out of order.
namespace {

struct FakeDevice {
  GstDevice parent;
};
struct FakeDeviceClass {
  GstDeviceClass parent_class;
};
G_DEFINE_TYPE(FakeDevice, fake_device, GST_TYPE_DEVICE)

// Devices without a path are created by name, like devices of libcamera and Aravis.
GstElement* fake_create(GstDevice* device, const gchar*) {
  g_autofree gchar* name = gst_device_get_display_name(device);
  if (!g_str_has_prefix(name, "industrial")) return nullptr;
  GstElement* element = gst_element_factory_make("filesrc", nullptr);
  g_object_set(element, "location", name, "num-buffers", 7, nullptr);
  return element;
}
void fake_device_class_init(FakeDeviceClass* klass) { GST_DEVICE_CLASS(klass)->create_element = fake_create; }
void fake_device_init(FakeDevice*) {}

struct FakeProvider {
  GstDeviceProvider parent;
};
struct FakeProviderClass {
  GstDeviceProviderClass parent_class;
};
G_DEFINE_TYPE(FakeProvider, fake_provider, GST_TYPE_DEVICE_PROVIDER)

struct Fake {
  std::string name, device_class, field, value, serial;
};
std::vector<Fake>& plugged() {
  static std::vector<Fake> devices;
  return devices;
}

GList* fake_probe(GstDeviceProvider*) {
  GList* list = nullptr;
  for (const Fake& d : plugged()) {
    GstStructure* properties =
        gst_structure_new("properties", d.field.c_str(), G_TYPE_STRING, d.value.c_str(), nullptr);
    if (!d.serial.empty()) gst_structure_set(properties, "device.serial", G_TYPE_STRING, d.serial.c_str(), nullptr);
    g_autoptr(GstCaps) caps = gst_caps_new_empty_simple("video/x-raw");
    list = g_list_append(list, g_object_new(fake_device_get_type(), "display-name", d.name.c_str(), "device-class",
                                            d.device_class.c_str(), "caps", caps, "properties", properties, nullptr));
    gst_structure_free(properties);
  }
  return list;
}

void fake_provider_class_init(FakeProviderClass* klass) {
  klass->parent_class.probe = fake_probe;
  gst_device_provider_class_set_static_metadata(&klass->parent_class, "Fake", "Source/Video/Audio", "Fake", "none");
}
void fake_provider_init(FakeProvider*) {}

class VideoDevices : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    // Exclude real cameras of the machine.
    GList* providers = gst_device_provider_factory_list_get_device_providers(GST_RANK_NONE);
    for (GList* item = providers; item; item = item->next)
      gst_registry_remove_feature(gst_registry_get(), GST_PLUGIN_FEATURE(item->data));
    gst_plugin_feature_list_free(providers);
    gst_device_provider_register(nullptr, "fakeprovider", GST_RANK_PRIMARY, fake_provider_get_type());
  }
};

TEST_F(VideoDevices, AreFoundByNumberEachOnce) {
  plugged() = {
      {"ten", "Video/Source", "device.path", "/dev/video10", ""},
      {"two", "Video/Source", "device.path", "/dev/video2", ""},
      {"two again", "Video/Source", "api.v4l2.path", "/dev/video2", ""},
      {"zero", "Video/Source", "api.v4l2.path", "/dev/video0", ""},
      {"screen", "Video/Source", "display", ":0", ""},
      {"industrial screen", "Video/Source/Screen", "display", ":1", ""},
      {"microphone", "Audio/Source", "device.path", "/dev/snd0", ""},
  };
  const std::vector<VideoDevice> devices = find_video_devices("/nowhere");
  ASSERT_EQ(devices.size(), 3u);
  EXPECT_EQ(devices[0].source, "v4l2:///dev/video0");
  EXPECT_EQ(devices[0].name, "zero");
  EXPECT_EQ(devices[1].source, "v4l2:///dev/video2");
  EXPECT_EQ(devices[2].source, "v4l2:///dev/video10");
  for (const VideoDevice& device : devices) EXPECT_FALSE(device.stable) << "numbers may change at the next start";
}

TEST_F(VideoDevices, AreNamedByTheirPort) {
  const TempDir dir;
  dir.write("video0", "");
  dir.write("video1", "");
  std::filesystem::create_directory(dir / "by-path");
  std::filesystem::create_symlink("../video1", dir / "by-path/pci-0000:00:14.0-usb-0:1.2:1.0-video-index0");
  std::filesystem::create_symlink("../video0", dir / "by-path/pci-0000:00:14.0-usb-0:1.10:1.0-video-index0");
  std::filesystem::create_symlink("../gone", dir / "by-path/pci-0000:00:14.0-usb-0:9:1.0-video-index0");
  plugged() = {{"webcam", "Video/Source", "device.path", dir / "video0", "A1"},
               {"webcam", "Video/Source", "device.path", dir / "video1", ""}};
  const std::vector<VideoDevice> devices = find_video_devices(dir / "by-path");
  ASSERT_EQ(devices.size(), 2u);
  EXPECT_EQ(devices[0].source, "v4l2://" + (dir / "by-path/pci-0000:00:14.0-usb-0:1.2:1.0-video-index0"));
  EXPECT_EQ(devices[1].source, "v4l2://" + (dir / "by-path/pci-0000:00:14.0-usb-0:1.10:1.0-video-index0"));
  EXPECT_EQ(devices[1].name, "webcam, serial A1");
  EXPECT_TRUE(devices[0].stable && devices[1].stable);
}

TEST_F(VideoDevices, AreLaunchDescriptionsForOtherProviders) {
  plugged() = {{"industrial \"b\" 2", "Video/Source", "serial", "2", ""},
               {"industrial a", "Source/Video", "serial", "1", ""}};
  const std::vector<VideoDevice> devices = find_video_devices();
  ASSERT_EQ(devices.size(), 2u);
  EXPECT_EQ(devices[1].name, "industrial a, serial 1");
  for (const VideoDevice& device : devices) {
    EXPECT_TRUE(device.stable);
    g_autoptr(GError) error = nullptr;
    g_autoptr(GstElement) element = gst_parse_launch(device.source.c_str(), &error);
    ASSERT_TRUE(element && !error) << device.source;
    g_autofree gchar* location = nullptr;
    gint buffers = 0;
    g_object_get(element, "location", &location, "num-buffers", &buffers, nullptr);
    EXPECT_EQ(device.name.rfind(location, 0), 0u) << "element of the device: " << device.source;
    EXPECT_EQ(buffers, 7);
  }
}

}  // namespace
