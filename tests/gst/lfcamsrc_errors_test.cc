// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gmock/gmock.h>
#include <gst/gst.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "gst/camera_fixture.h"
#include "gst/camera_pipeline.h"
#include "gst/gst_test.h"

namespace lf::test {
namespace {

using ::testing::HasSubstr;

// Each bad input and what the message says of the place.
TEST_F(CamSrcTest, ErrorsNameThePlace) {
  const auto write = [&](const std::string& name, const std::string& text) {
    std::ofstream(files->path(name)) << text;
    return files->path(name);
  };
  const auto good = [&](const std::string& name, const std::string& source, int width = CameraFiles::kWidth) {
    return files->save(name, 1, [&](Camera& camera) {
      camera.source = source;
      camera.width = width;
    });
  };
  write("empty.mkv", "");
  write("broken.png", "\x89PNG\r\n\x1a\nnothing more");
  write("broken.mkv", "\x1a\x45\xdf\xa3 nothing more");
  std::filesystem::create_directory(files->path("folder"));
  const std::string in_a = files->path("a.json") + ": camera 0 (cam_0): ";
  struct Case {
    const char* what;
    std::string properties;
    bool at_state_change;  // else with the data
    std::vector<std::string> words;
  };
  const std::vector<std::function<Case()>> cases = {
      [&] {
        return Case{"no rig", "", true, {"rig: not set"}};
      },
      [&] {
        return Case{"rig missing", "rig=" + files->path("none.json"), true, {"none.json", "no such file"}};
      },
      [&] {
        return Case{"rig not JSON", "rig=" + write("b.json", "{\"format\": "), true, {files->path("b.json")}};
      },
      [&] {
        return Case{"rig without cameras",
                    "rig=" + write("c.json", R"({"format": "lightfield-rig", "version": 1})"),
                    true,
                    {files->path("c.json"), "cameras"}};
      },
      [&] {
        return Case{"no such camera", "camera=7 rig=" + good("a.json", ""), true, {"a.json", "no camera 7"}};
      },
      [&] {
        return Case{
            "file missing", "rig=" + good("a.json", "no.mkv"), true, {in_a + files->path("no.mkv"), "no such file"}};
      },
      [&] {
        return Case{"folder", "rig=" + good("a.json", "folder"), true, {in_a + files->path("folder"), "not a file"}};
      },
      [&] {
        return Case{"sequence missing",
                    "rig=" + good("a.json", "no_%03d.png"),
                    true,
                    {in_a + files->path("no_%03d.png"), "no such files"}};
      },
      [&] {
        return Case{"pattern with two numbers", "rig=" + good("a.json", "%d_%d.png"), true, {in_a, "\"%d_%d.png\""}};
      },
      [&] {
        return Case{"pattern with a string", "rig=" + good("a.json", "a_%s.png"), true, {in_a, "\"a_%s.png\""}};
      },
      [&] {
        return Case{"sequence of videos", "rig=" + good("a.json", "empty%%_%d.mkv"), true, {in_a, "no such files"}};
      },
      [&] {
        return Case{"wrong size of a video",
                    "rig=" + good("a.json", "mjpeg.mkv", 100),
                    false,
                    {in_a + files->path("mjpeg.mkv"), "64x48", "100x48"}};
      },
      [&] {
        return Case{"wrong size of a sequence",
                    "rig=" + good("a.json", "jpeg_%02d.jpg", 100),
                    false,
                    {in_a, "jpeg_%02d.jpg", "64x48", "100x48"}};
      },
      [&] {
        return Case{"wrong size of a still",
                    "rig=" + good("a.json", "png_1.png", 100),
                    false,
                    {in_a + files->path("png_1.png"), "64x48", "100x48"}};
      },
      [&] {
        return Case{"wrong size of another file",
                    "rig=" + good("a.json", "mjpeg.avi", 100),
                    false,
                    {in_a, "mjpeg.avi", "64x48", "100x48"}};
      },
      [&] {
        return Case{"empty file", "rig=" + good("a.json", "empty.mkv"), false, {in_a, "empty.mkv"}};
      },
      [&] {
        return Case{"broken PNG", "rig=" + good("a.json", "broken.png"), false, {in_a, "broken.png"}};
      },
      [&] {
        return Case{"broken Matroska", "rig=" + good("a.json", "broken.mkv"), false, {in_a, "broken.mkv"}};
      },
      [&] {
        return Case{"no video", "rig=" + good("a.json", "sound.mkv"), false, {in_a, "sound.mkv", "no video"}};
      },
      [&] {
        return Case{"unknown URI", "trusted=true rig=" + good("a.json", "nothing://x"), false, {in_a, "nothing://x"}};
      },
  };
  for (const auto& make : cases) {
    const Case c = make();
    SCOPED_TRACE(c.what);
    CameraPipeline camera(c.properties);
    const GstStateChangeReturn result = camera.set_state(GST_STATE_PLAYING);
    if (c.at_state_change) {
      EXPECT_EQ(result, GST_STATE_CHANGE_FAILURE);
    }
    const std::string text = camera.wait();
    for (const std::string& word : c.words) EXPECT_THAT(text, HasSubstr(word));
    EXPECT_EQ(camera.wait(GST_MSECOND), "timeout") << "one error is enough";
    camera.set_state(GST_STATE_NULL);
    EXPECT_TRUE(camera.frames.empty());
    EXPECT_EQ(GST_BIN_NUMCHILDREN(camera.camera()), 0);
  }
}

// All that a pipeline says: messages, and what our categories log at the highest level.
class Listener {
 public:
  Listener() {
    gst_debug_set_threshold_from_string("lf*:9", FALSE);
    gst_debug_add_log_function(log, this, nullptr);
  }
  ~Listener() {
    gst_debug_remove_log_function_by_data(this);
    gst_debug_set_threshold_from_string("lf*:1", FALSE);
  }
  // Until an error, or for `patience` in all: a camera that is tried again always has something to say.
  void read(GstElement* pipeline, GstClockTime patience) {
    g_autoptr(GstBus) bus = gst_element_get_bus(pipeline);
    const gint64 end = g_get_monotonic_time() + static_cast<gint64>(patience / GST_USECOND);
    for (bool going = true; going;) {
      const gint64 left = std::max<gint64>(0, end - g_get_monotonic_time());
      GstMessage* message = gst_bus_timed_pop(bus, static_cast<GstClockTime>(left) * GST_USECOND);
      if (!message) break;
      going = GST_MESSAGE_TYPE(message) != GST_MESSAGE_ERROR;
      if (const GstStructure* structure = gst_message_get_structure(message)) {
        g_autofree gchar* text = gst_structure_to_string(structure);
        add(text);
      }
      problems_ += GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR || GST_MESSAGE_TYPE(message) == GST_MESSAGE_WARNING;
      // Structures print errors as pointers.
      g_autoptr(GError) error = nullptr;
      g_autofree gchar* debug = nullptr;
      if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR) gst_message_parse_error(message, &error, &debug);
      if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_WARNING) gst_message_parse_warning(message, &error, &debug);
      if (error) add(error->message);
      if (debug) add(debug);
      gst_message_unref(message);
    }
  }
  int problems() const { return problems_; }
  std::string said() const {
    const std::lock_guard lock(mutex_);
    return said_;
  }

 private:
  void add(const char* text) {
    const std::lock_guard lock(mutex_);
    said_ += std::string(text) + "\n";
  }
  static void log(GstDebugCategory* category, GstDebugLevel, const gchar*, const gchar*, gint, GObject*,
                  GstDebugMessage* message, gpointer self) {
    if (g_str_has_prefix(gst_debug_category_get_name(category), "lf"))
      static_cast<Listener*>(self)->add(gst_debug_message_get(message));
  }
  mutable std::mutex mutex_;
  std::string said_;
  int problems_ = 0;
};

TEST_F(CamSrcTest, NeverTellsPasswords) {
  const char* const sources[] = {
      "rtsp://admin:Hunter2Secret@127.0.0.1:1/stream",
      "rtsp://Hunter2Secret@127.0.0.1:1/stream",
      "http://admin:Hunter2Secret@127.0.0.1:1/a.jpg",
      "http://127.0.0.1:1/video.cgi?user=admin&pwd=Hunter2Secret",
      "nothing://admin:Hunter2Secret@host/x",
      "rtspsrc location=rtsp://127.0.0.1:1/ user-id=me user-pw=Hunter2Secret ! decodebin",
      "rtspsrc location=rtsp://me:Hunter2Secret@127.0.0.1:1/ ! decodebin",
      "souphttpsrc location=http://127.0.0.1:1/ user-pw=\"Hunter2Secret and more\" ! jpegdec",
      "rtspsrc nosuch=1 user-pw=Hunter2Secret ! decodebin",
      "nosuchelement password=Hunter2Secret ! decodebin",
  };
  for (const char* source : sources)
    for (const char* retry : {"false", "true"}) {
      SCOPED_TRACE(std::string(source) + " retry=" + retry);
      Listener listener;
      CameraPipeline camera("rig=" + rig_with_source(source) + " trusted=true retry=" + retry);
      camera.set_state(GST_STATE_PLAYING);
      listener.read(camera.pipeline(), (*retry == 't' ? 1 : 3) * GST_SECOND);
      g_autoptr(GstStructure) stats = nullptr;
      g_object_get(camera.camera(), "stats", &stats, nullptr);
      g_autofree gchar* text = gst_structure_to_string(stats);
      camera.set_state(GST_STATE_NULL);
      EXPECT_GT(listener.problems(), 0) << "there is something to tell";
      EXPECT_THAT(listener.said() + text, ::testing::Not(HasSubstr("Hunter2Secret")));
    }
}

TEST_F(CamSrcTest, IsUsableAgainAfterAnError) {
  CameraPipeline camera("rig=" + rig_with_source("no.mkv") + " num-frames=1");
  ASSERT_THAT(camera.play(), HasSubstr("no.mkv"));
  rig_with_source("mjpeg.mkv");
  g_object_set(camera.camera(), "rig", files->path("rig.json").c_str(), nullptr);
  EXPECT_EQ(camera.play(), "EOS");
}

}  // namespace
}  // namespace lf::test
