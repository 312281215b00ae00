// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Pictures and cameras' frames in a graphics card's memory: of the array's elements alone, and with GStreamer's
// glupload behind them and gldownload before them.
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <gst/app/gstappsink.h>
#include <gst/gl/egl/gstgldisplay_egl.h>
#include <gst/gl/gl.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "gst/gst_test.h"
#include "rig/rig_json.h"
#include "scene/scene.h"
#include "support/temp_dir.h"
#include "view/views_json.h"

namespace lf::test {
namespace {

// Mesa's display that needs no screen, of which GStreamer 1.22 does not know: it is told.
class CardMemory : public testing::Test {
 protected:
  void SetUp() override {
    display_ = eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
    ASSERT_NE(display_, EGL_NO_DISPLAY);
    ASSERT_TRUE(eglInitialize(display_, nullptr, nullptr));
    save_array("rig.json", "");
    std::vector<NamedView> path;
    for (int i = 0; i < kPictures; i++) {
      View view{.width = 128, .height = 96, .lens = Lens::from_fov_y(25, 128, 96), .pose = {}, .focus = {}};
      view.pose.position = {0.01 + 0.001 * i, 0.01, 0};
      view.focus.plane = focal_plane_at(view.pose, 2.2);
      path.push_back({"view_" + std::to_string(i), 0.1 * i, view});
    }
    save_views(path, dir_ / "views.json");
  }

  // Four cameras of this source; none: of the built-in scene.
  void save_array(const std::string& name, const std::string& source) {
    Rig rig = scene_rig(2, 2, 96, 72);
    for (Camera& camera : rig.cameras) {
      camera.image.clear();
      if (!source.empty()) camera.source = source;
    }
    save_rig(rig, dir_ / name);
  }

  // Bytes of the pictures that leave a pipeline by an appsink of the name `out`, and which error it ends with.
  std::vector<std::vector<uint8_t>> pictures(const std::string& line, const std::string& error = "") {
    SCOPED_TRACE(line);
    std::vector<std::vector<uint8_t>> all;
    const ElementPtr pipeline = launch(line + " ! appsink name=out sync=false");
    if (!pipeline) return all;
    GstContext* context = gst_context_new(GST_GL_DISPLAY_CONTEXT_TYPE, TRUE);
    GstGLDisplay* shared = GST_GL_DISPLAY(gst_gl_display_egl_new_with_egl_display(display_));
    gst_context_set_gl_display(context, shared);
    gst_element_set_context(pipeline.get(), context);
    gst_context_unref(context);
    gst_object_unref(shared);
    watch(GST_BIN(pipeline.get()));
    const ElementPtr sink(gst_bin_get_by_name(GST_BIN(pipeline.get()), "out"));
    gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
    GstBus* bus = gst_element_get_bus(pipeline.get());
    std::string came;
    const gint64 end = g_get_monotonic_time() + 20 * G_TIME_SPAN_SECOND;
    while (came.empty() && !gst_app_sink_is_eos(GST_APP_SINK(sink.get())) && g_get_monotonic_time() < end) {
      if (GstSample* sample = gst_app_sink_try_pull_sample(GST_APP_SINK(sink.get()), GST_SECOND / 20)) {
        all.push_back(to_bytes(gst_sample_get_buffer(sample)));
        gst_sample_unref(sample);
      }
      if (GstMessage* message = gst_bus_pop_filtered(bus, GST_MESSAGE_ERROR)) {
        GError* details = nullptr;
        gst_message_parse_error(message, &details, nullptr);
        came = details->message;
        g_error_free(details);
        gst_message_unref(message);
      }
    }
    gst_object_unref(bus);
    EXPECT_EQ(came, error);
    gst_element_set_state(pipeline.get(), GST_STATE_NULL);
    return all;
  }

  // Counts the buffers that come to the element of the name `look`, and those that are in the card's memory by then.
  void watch(GstBin* pipeline) {
    came_ = in_card_ = 0;
    const ElementPtr element(gst_bin_get_by_name(pipeline, "look"));
    if (!element) return;
    GstPad* pad = gst_element_get_static_pad(element.get(), "sink");
    const auto look = [](GstPad*, GstPadProbeInfo* info, gpointer data) {
      auto* const self = static_cast<CardMemory*>(data);
      self->came_++;
      if (gst_is_gl_memory(gst_buffer_peek_memory(GST_PAD_PROBE_INFO_BUFFER(info), 0))) self->in_card_++;
      return GST_PAD_PROBE_OK;
    };
    gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_BUFFER, look, this, nullptr);
    gst_object_unref(pad);
  }
  // The pictures of four cameras whose frames go `in` to a node, and which leave the compositor as `out` says.
  std::vector<std::vector<uint8_t>> array(const std::string& in, const std::string& out,
                                          const std::string& error = "") {
    const std::string rig = " rig=" + dir_ / "rig.json";
    std::string line = "lfviewrequest location=" + dir_ / "views.json" +
                       " ! tee name=r r. ! queue ! c.request lfcompositor name=c focus=plane r. ! queue ! n.request "
                       "lffragment name=n" +
                       rig + " ! c.sink_0";
    for (const std::string camera : {"0", "1", "2", "3"})
      line += " lfcamsrc" + rig + " camera=" + camera + in + " ! n.sink_" + camera;
    return pictures(line + " c. ! " + out, error);
  }

  static constexpr int kPictures = 8;
  const TempDir dir_;
  EGLDisplay display_ = EGL_NO_DISPLAY;
  int came_ = 0, in_card_ = 0;
};

// Nothing is copied between the compositor and the card: what is behind it proposes memory, and that is what pictures
// are written to. Elements that take nothing else are linked as they are.
TEST_F(CardMemory, PicturesAreMadeInIt) {
  const struct {
    std::string of_cameras, of_pictures;
  } formats[] = {{"RGB", "RGBA"}, {"I420", "I420"}, {"I420", "NV12"}};
  for (const auto& format : formats) {
    SCOPED_TRACE(format.of_pictures);
    const std::string in = " ! videoconvert ! video/x-raw,format=" + format.of_cameras,
                      out = ",format=" + format.of_pictures, back = " ! gldownload ! video/x-raw" + out;
    const auto plain = array(in, "video/x-raw" + out);
    ASSERT_EQ(plain.size(), static_cast<size_t>(kPictures));
    for (const std::string& to_card : {"video/x-raw" + out + " ! glupload name=look",
                                       "video/x-raw(memory:GLMemory)" + out + " ! identity name=look"}) {
      EXPECT_TRUE(plain == array(in, to_card + back));
      EXPECT_EQ(came_, kPictures);
      EXPECT_EQ(in_card_, kPictures);
    }
  }
}

// A viewer's, of several views each, which a filter then has; it does nothing to them.
TEST_F(CardMemory, PicturesOfLfviewsrcAre) {
  save_array("rig.json", "videotestsrc pattern=ball num-buffers=30 ! video/x-raw,format=RGBA");
  const std::string line = "lfviewsrc is-live=false num-buffers=4 focus=plane rig=" + dir_ / "rig.json" +
                           " width=96 height=72 views=row columns=3 ! ",
                    back = " ! gldownload ! video/x-raw,format=RGBA";
  const auto plain = pictures(line + "video/x-raw,format=RGBA");
  ASSERT_EQ(plain.size(), 4u);
  for (const std::string to_card :
       {"glupload name=look", "video/x-raw(memory:GLMemory),format=RGBA ! identity name=look",
        "identity name=look ! gleffects effect=identity"}) {
    EXPECT_TRUE(plain == pictures(line + to_card + back)) << to_card;
    EXPECT_EQ(in_card_, 4) << to_card;
  }
}

// A sink that has none of it to offer, and a filter that takes another format.
TEST_F(CardMemory, WhoHasNoneIsTold) {
  const auto error = [](const std::string& format) {
    return "Downstream takes no " + format +
           " video of 128x96 pixels in a graphics card's memory, or has no memory for it: glupload ! glcolorconvert in "
           "between do.";
  };
  EXPECT_TRUE(array("", "video/x-raw(memory:GLMemory)", error("RGB")).empty());
  const std::string in = " ! videoconvert ! video/x-raw,format=I420", out = "gleffects effect=identity ! gldownload";
  EXPECT_TRUE(array(in, out, error("I420")).empty());
  EXPECT_EQ(array(in, "glupload ! glcolorconvert ! " + out).size(), static_cast<size_t>(kPictures));
}

// What was decoded on a card comes to a node as it is, or by gldownload.
TEST_F(CardMemory, FramesComeFromIt) {
  const std::string out = "video/x-raw,format=RGB";
  const auto plain = array("", out);
  ASSERT_EQ(plain.size(), static_cast<size_t>(kPictures));
  EXPECT_TRUE(plain == array(" ! glupload ! gldownload", out));
  EXPECT_TRUE(plain == array(" ! glupload ! video/x-raw(memory:GLMemory)", out));
  for (const std::string format : {"I420", "NV12", "RGBA"}) {
    const std::string in = " ! videoconvert ! video/x-raw,format=" + format;
    const auto of_format = array(in, "video/x-raw");
    EXPECT_EQ(of_format.size(), static_cast<size_t>(kPictures));
    EXPECT_TRUE(of_format == array(in + " ! glupload ! video/x-raw(memory:GLMemory)", "video/x-raw")) << format;
  }
}

TEST_F(CardMemory, FramesOfElementsThatTheRigDescribesComeFromIt) {
  const std::string source = "videotestsrc pattern=ball num-buffers=30 ! video/x-raw,format=RGBA";
  save_array("plain.json", source);
  save_array("card.json", source + " ! glupload ! gldownload");
  const auto views = [&](const std::string& rig) {
    return pictures("lfviewsrc is-live=false focus=plane rig=" + dir_ / rig + " location=" + dir_ / "views.json");
  };
  const auto plain = views("plain.json");
  ASSERT_EQ(plain.size(), static_cast<size_t>(kPictures));
  EXPECT_TRUE(plain == views("card.json"));
}

}  // namespace
}  // namespace lf::test
