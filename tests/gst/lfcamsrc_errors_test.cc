// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gmock/gmock.h>
#include <gst/gst.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
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
        return Case{"unknown URI", "rig=" + good("a.json", "nothing://x"), false, {in_a, "nothing://x"}};
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

TEST_F(CamSrcTest, IsUsableAgainAfterAnError) {
  CameraPipeline camera("rig=" + rig_with_source("no.mkv") + " num-frames=1");
  ASSERT_THAT(camera.play(), HasSubstr("no.mkv"));
  rig_with_source("mjpeg.mkv");
  g_object_set(camera.camera(), "rig", files->path("rig.json").c_str(), nullptr);
  EXPECT_EQ(camera.play(), "EOS");
}

}  // namespace
}  // namespace lf::test
