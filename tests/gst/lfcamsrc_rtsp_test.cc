// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Network cameras: an RTSP server on loopback, where its library is installed.
#include <gmock/gmock.h>
#include <gst/gst.h>
#include <gtest/gtest.h>

#if LF_HAS_RTSP_SERVER
#include <gst/rtsp-server/rtsp-server.h>
#endif

#include <cstdlib>
#include <string>
#include <thread>

#include "../gst/common.h"
#include "gst/camera_pipeline.h"
#include "gst/gst_test.h"

namespace lf::test {
namespace {

using ::testing::HasSubstr;

#if LF_HAS_RTSP_SERVER
constexpr const char* kMissing = nullptr;

// Serves white pictures of 64x48 at 30 frames/s, /jpeg and (where there is an encoder) /h264, until it is destroyed.
class RtspServer {
 public:
  RtspServer()
      : context_(g_main_context_new()), loop_(g_main_loop_new(context_, FALSE)), server_(gst_rtsp_server_new()) {
    gst_rtsp_server_set_address(server_, "127.0.0.1");
    gst_rtsp_server_set_service(server_, "0");
    mount("/jpeg", "jpegenc ! rtpjpegpay name=pay0");
    mount("/h264", CameraFiles::h264_encoder() + " ! rtph264pay name=pay0");
    gst_rtsp_server_attach(server_, context_);
    thread_ = std::thread([this] {
      g_main_context_push_thread_default(context_);
      g_main_loop_run(loop_);
      g_main_context_pop_thread_default(context_);
    });
  }
  ~RtspServer() {
    gst_rtsp_server_client_filter(
        server_, [](GstRTSPServer*, GstRTSPClient*, gpointer) { return GST_RTSP_FILTER_REMOVE; }, nullptr);
    g_main_loop_quit(loop_);
    thread_.join();
    g_object_unref(server_);
    g_main_loop_unref(loop_);
    g_main_context_unref(context_);
    gst_rtsp_thread_pool_cleanup();
  }
  std::string uri(const std::string& path) const {
    return "rtsp://127.0.0.1:" + std::to_string(gst_rtsp_server_get_bound_port(server_)) + path;
  }

 private:
  void mount(const char* path, const std::string& coder) {
    GstRTSPMountPoints* mounts = gst_rtsp_server_get_mount_points(server_);
    GstRTSPMediaFactory* factory = gst_rtsp_media_factory_new();
    const std::string line =
        "( videotestsrc is-live=true pattern=white ! video/x-raw,format=I420,width=64,height=48,framerate=30/1 ! " +
        coder + " )";
    gst_rtsp_media_factory_set_launch(factory, line.c_str());
    gst_rtsp_media_factory_set_shared(factory, TRUE);
    gst_rtsp_mount_points_add_factory(mounts, path, factory);  // takes it
    g_object_unref(mounts);
  }

  GMainContext* context_;
  GMainLoop* loop_;
  GstRTSPServer* server_;
  std::thread thread_;
};
#else
constexpr const char* kMissing = "libgstrtspserver-1.0-dev is not installed";
class RtspServer {
 public:
  std::string uri(const std::string& path) const { return path; }
};
#endif

class RtspTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    if (kMissing) return;
    files = new CameraFiles;
    server = new RtspServer;
  }
  static void TearDownTestSuite() {
    delete server;
    delete files;
  }
  void SetUp() override {
    if (kMissing) GTEST_SKIP() << kMissing;
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
