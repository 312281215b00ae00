// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Network cameras: an RTSP server on loopback, where its library is installed.
#include <gmock/gmock.h>
#include <gst/gst.h>
#include <gtest/gtest.h>

#include <string>

#include "../gst/common.h"
#include "gst/camera_pipeline.h"
#include "gst/gst_test.h"
#include "gst/rtsp_server.h"

namespace lf::test {
namespace {

using ::testing::HasSubstr;

class RtspTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    if (kRtspServerMissing) return;
    files = new CameraFiles;
    server = new RtspServer;
  }
  static void TearDownTestSuite() {
    delete server;
    if (server) RtspServer::clean_up();
    delete files;
  }
  void SetUp() override {
    if (kRtspServerMissing) GTEST_SKIP() << kRtspServerMissing;
  }
  static std::string rig(const std::string& path, int width = CameraFiles::kWidth) {
    return files->save("rig.json", 1, [&](Camera& camera) {
      camera.source = server->uri(path);
      camera.width = width;
    });
  }
  static CameraFiles* files;
  static RtspServer* server;
};
CameraFiles* RtspTest::files = nullptr;
RtspServer* RtspTest::server = nullptr;

TEST_F(RtspTest, FramesAreLiveAndOfTheClock) {
  for (const std::string path : {"/jpeg", "/h264"}) {
    if (path == "/h264" && CameraFiles::h264_encoder().empty()) {
      std::printf("no encoder and decoder of H.264 are installed\n");
      continue;
    }
    CameraPipeline camera("num-frames=10 latency=50 rig=" + rig(path));
    for (int i = 0; i < 4; ++i) {
      camera.frames.clear();
      ASSERT_EQ(camera.set_state(GST_STATE_PAUSED), GST_STATE_CHANGE_NO_PREROLL) << path << ": live, said or not";
      ASSERT_EQ(camera.play(), "EOS") << path << " " << i;
      ASSERT_EQ(camera.frames.size(), 10u);
      EXPECT_EQ(camera.info.width, 64);
      const GstClockTime base_time = gst_element_get_base_time(camera.pipeline());
      for (const Frame& frame : camera.frames) {
        EXPECT_EQ(frame.capture_time, base_time + frame.running_time) << path;
        EXPECT_GT(frame.level, 220) << path << ": white";
      }
    }
  }
}

TEST_F(RtspTest, JpegStaysJpegWhereItIsNotDecoded) {
  const ElementPtr pipeline =
      launch("lfcamsrc decode=false latency=50 num-frames=5 rig=" + rig("/jpeg") + " ! image/jpeg ! fakesink");
  ASSERT_TRUE(pipeline);
  EXPECT_EQ(run(pipeline.get()), "");
}

TEST_F(RtspTest, ErrorsNameThePlace) {
  EXPECT_THAT(CameraPipeline("rig=" + rig("/jpeg", 66)).play(),
              HasSubstr(server->uri("/jpeg") + ": the picture is 64x48, the rig says 66x48"));
  EXPECT_THAT(CameraPipeline("rig=" + rig("/nothing")).play(),
              HasSubstr("camera 0 (cam_0): " + server->uri("/nothing")));
}

// A node of a network camera, which is late, and a film: both are in the picture.
TEST_F(RtspTest, BesideAFilmInOneNode) {
  const std::string rig = files->save(
      "mixed.json", 2, [](Camera& camera) { camera.source = camera.id == 0 ? server->uri("/jpeg") : "mjpeg.mkv"; });
  const ElementPtr pipeline =
      launch("lfviewrequest is-live=true framerate=15/1 capture-delay=400000000 rig=" + rig +
             " ! lfcameranode name=n is-live=true loop=true latency=100 sum=camera rig=" + rig + " ! fakesink");
  ASSERT_TRUE(pipeline);
  ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  const ElementPtr node(gst_bin_get_by_name(GST_BIN(pipeline.get()), "n"));
  uint64_t whole = 0;
  for (int i = 0; i < 300 && whole < 10; ++i) {  // answers with a frame of both cameras
    const uint64_t fragments = stat(node.get(), "fragments"), answers = stat(node.get(), "answers");
    whole = fragments > answers ? fragments - answers : 0;
    g_usleep(50000);
  }
  EXPECT_GE(whole, 10u);
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
}

}  // namespace
}  // namespace lf::test
