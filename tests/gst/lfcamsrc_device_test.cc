// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Capture devices by URI. One that speaks like a webcam stands for hardware: a live source that has its pictures in two
// sizes, the larger one first, in YUY2 and, at a higher rate, in JPEG.
#include <gmock/gmock.h>
#include <gst/gst.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "../gst/common/common.h"
#include "gst/camera_pipeline.h"
#include "gst/gst_test.h"

namespace lf::test {
namespace lfcamsrc_device_test {

using ::testing::HasSubstr;

struct FakeWebcam {
  GstBin parent;
};
struct FakeWebcamClass {
  GstBinClass parent_class;
};

GstURIType uri_type(GType) { return GST_URI_SRC; }
const gchar* const* uri_protocols(GType) {
  static const gchar* const protocols[] = {"webcam", nullptr};
  return protocols;
}
gchar* get_uri(GstURIHandler*) { return g_strdup("webcam://"); }
gboolean set_uri(GstURIHandler*, const gchar*, GError**) { return TRUE; }
void uri_handler_init(gpointer iface, gpointer) {
  auto* handler = static_cast<GstURIHandlerInterface*>(iface);
  handler->get_type = uri_type;
  handler->get_protocols = uri_protocols;
  handler->get_uri = get_uri;
  handler->set_uri = set_uri;
}

G_DEFINE_TYPE_WITH_CODE(FakeWebcam, fake_webcam, GST_TYPE_BIN,
                        G_IMPLEMENT_INTERFACE(GST_TYPE_URI_HANDLER, uri_handler_init))

GstStaticPadTemplate webcam_template =
    GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS,
                            GST_STATIC_CAPS("video/x-raw, format=YUY2, width=640, height=480, framerate=10/1;"
                                            "video/x-raw, format=YUY2, width=64, height=48, framerate={15/1, 10/1};"
                                            "image/jpeg, width=64, height=48, framerate=30/1"));

void fake_webcam_class_init(FakeWebcamClass* klass) {
  gst_element_class_add_static_pad_template(GST_ELEMENT_CLASS(klass), &webcam_template);
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Webcam", "Source/Video", "Fake", "none");
}

// Which of its formats it is to give is seen only when somebody asks for caps.
void choose_format(GstPad* ghost, GstPad*, gpointer data) {
  auto* self = static_cast<GstElement*>(data);
  GstCaps* asked = gst_pad_peer_query_caps(ghost, nullptr);
  GstCaps* mine = gst_static_pad_template_get_caps(&webcam_template);
  const bool can = gst_caps_can_intersect(mine, asked);  // else it gives what it has, which is refused
  GstCaps* caps = gst_caps_fixate(can ? gst_caps_intersect(mine, asked) : gst_caps_ref(mine));
  const bool jpeg = gst_structure_has_name(gst_caps_get_structure(caps, 0), "image/jpeg");
  GstElement* test = gst_element_factory_make("videotestsrc", nullptr);
  GstElement* filter = gst_element_factory_make("capsfilter", nullptr);
  GstElement* coder = gst_element_factory_make(jpeg ? "jpegenc" : "identity", nullptr);
  GstCaps* raw = gst_caps_copy(caps);
  if (jpeg) gst_structure_set_name(gst_caps_get_structure(raw, 0), "video/x-raw");
  g_object_set(test, "is-live", TRUE, nullptr);
  g_object_set(filter, "caps", raw, nullptr);
  gst_bin_add_many(GST_BIN(self), test, filter, coder, nullptr);
  gst_element_link_many(test, filter, coder, nullptr);
  GstPad* target = gst_element_get_static_pad(coder, "src");
  gst_ghost_pad_set_target(GST_GHOST_PAD(ghost), target);
  gst_object_unref(target);
  for (GstCaps* c : {asked, mine, caps, raw}) gst_caps_unref(c);
}

void fake_webcam_init(FakeWebcam* self) {
  GstPadTemplate* pad_template = gst_static_pad_template_get(&webcam_template);
  GstPad* pad = gst_ghost_pad_new_no_target_from_template("src", pad_template);
  gst_object_unref(pad_template);
  g_signal_connect(pad, "linked", G_CALLBACK(choose_format), self);
  gst_element_add_pad(GST_ELEMENT(self), pad);
}

class DeviceTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    gst_element_register(nullptr, "fakewebcam", GST_RANK_PRIMARY, fake_webcam_get_type());
    files = new CameraFiles;
  }
  static void TearDownTestSuite() {
    delete files;
    files = nullptr;
  }
  static std::string rig_with_source(const std::string& source) {
    return files->save("rig.json", 1, [&](Camera& camera) { camera.source = source; });
  }
  static CameraFiles* files;
};
CameraFiles* DeviceTest::files = nullptr;

TEST_F(DeviceTest, IsAskedForTheSizeOfTheRig) {
  for (int i = 0; i < 10; i++) {
    CameraPipeline camera("num-frames=3 trusted=true rig=" + rig_with_source("webcam://0"));
    ASSERT_EQ(camera.set_state(GST_STATE_PAUSED), GST_STATE_CHANGE_NO_PREROLL) << "it is live, said or not";
    ASSERT_EQ(camera.play(), "EOS");
    EXPECT_EQ(camera.info.width, 64);
    EXPECT_EQ(camera.info.fps_n, 15);
    ASSERT_EQ(camera.frames.size(), 3u);
    EXPECT_GT(camera.frames[0].capture_time, camera.frames[0].running_time) << "clock time";
  }
}

TEST_F(DeviceTest, IsAskedForTheRateAndMayGiveJpeg) {
  CameraPipeline camera("num-frames=3 framerate=30/1 is-live=true trusted=true rig=" + rig_with_source("webcam://0"));
  ASSERT_EQ(camera.play(), "EOS");
  EXPECT_EQ(camera.info.fps_n, 30);
  EXPECT_EQ(camera.frames.size(), 3u);
}

TEST_F(DeviceTest, JpegStaysJpegWhereItIsNotDecoded) {
  const ElementPtr pipeline =
      launch("lfcamsrc decode=false num-frames=2 trusted=true rig=" + rig_with_source("webcam://0") +
             " ! image/jpeg,framerate=30/1 ! fakesink");
  ASSERT_TRUE(pipeline);
  EXPECT_EQ(run(pipeline.get()), "");
}

TEST_F(DeviceTest, ErrorsNameThePlace) {
  const std::string small = files->save("small.json", 1, [](Camera& camera) {
    camera.source = "webcam://0";
    camera.width = 62;
  });
  const std::string place = small + ": camera 0 (cam_0): webcam://0: ";
  EXPECT_THAT(CameraPipeline("trusted=true rig=" + small).play(), HasSubstr(place + "it gives no pictures of 62x48"));
  EXPECT_THAT(CameraPipeline("framerate=25/1 trusted=true rig=" + small).play(), HasSubstr("62x48 at 25/1 frames/s"));
  if (!ElementPtr(gst_element_factory_make("v4l2src", nullptr))) GTEST_SKIP() << "v4l2src is not installed";
  EXPECT_THAT(CameraPipeline("rig=" + rig_with_source("v4l2:///dev/video-none")).play(),
              testing::AllOf(HasSubstr("camera 0 (cam_0): v4l2:///dev/video-none: "), HasSubstr("Cannot identify")));
}

}  // namespace lfcamsrc_device_test
}  // namespace lf::test
