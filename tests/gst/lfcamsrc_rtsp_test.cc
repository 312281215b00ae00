// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Network cameras: an RTSP server on loopback, where its library is installed.
#include <gmock/gmock.h>
#include <gst/gst.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "../gst/common/common.h"
#include "gst/camera_pipeline.h"
#include "gst/gst_test.h"
#include "gst/loss_fixture.h"
#include "gst/rtsp_server.h"
#include "support/recorded.h"
#include "support/temp_dir.h"

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
    CameraPipeline camera("num-frames=10 latency=50000000 rig=" + rig(path));
    for (int i = 0; i < 4; ++i) {
      camera.frames.clear();
      ASSERT_EQ(camera.set_state(GST_STATE_PAUSED), GST_STATE_CHANGE_NO_PREROLL) << path << ": live, said or not";
      ASSERT_EQ(camera.play(), "EOS") << path << " " << i;
      ASSERT_EQ(camera.frames.size(), 10u);
      EXPECT_EQ(camera.info.width, 64);
      const GstClockTime base_time = gst_element_get_base_time(camera.pipeline());
      for (const Frame& frame : camera.frames) {
        // As it came, or as the server says, which is the same machine.
        const GstClockTimeDiff age = GST_CLOCK_DIFF(frame.capture_time, base_time + frame.running_time);
        EXPECT_LT(std::abs(age), static_cast<GstClockTimeDiff>(2 * GST_SECOND)) << path;
        EXPECT_GT(frame.level, 220) << path << ": white";
      }
    }
  }
}

// The server's sender reports come by and by: then frames have the times of day that it gives them.
TEST_F(RtspTest, SenderReportsSayWhenFramesWereTaken) {
  const ElementPtr pipeline =
      launch("lfcamsrc name=c latency=50000000 rig=" + rig("/jpeg") + " ! fakesink name=s sync=false");
  ASSERT_TRUE(pipeline);
  const ElementPtr camera(gst_bin_get_by_name(GST_BIN(pipeline.get()), "c"));
  const auto capture_time = [&]() -> std::string {
    GstStructure* stats = nullptr;
    g_object_get(camera.get(), "stats", &stats, nullptr);
    const StructurePtr owned(stats);
    const gchar* how = gst_structure_get_string(stats, "capture-time");
    return how ? how : "";
  };
  ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  EXPECT_THAT(capture_time(), testing::AnyOf("arrival", "sender-reports"));
  for (int i = 0; i < 600 && capture_time() != "sender-reports"; ++i) g_usleep(50000);
  EXPECT_EQ(capture_time(), "sender-reports");

  // The clock of what shows it is that of the server: so frames are as old as they are.
  const ElementPtr sink(gst_bin_get_by_name(GST_BIN(pipeline.get()), "s"));
  GstPad* pad = gst_element_get_static_pad(sink.get(), "sink");
  static std::atomic<int> frames, wrong;
  frames = wrong = 0;
  gst_pad_add_probe(
      pad, GST_PAD_PROBE_TYPE_BUFFER,
      [](GstPad* at, GstPadProbeInfo* info, gpointer) {
        GstCaps* reference = gst_caps_new_empty_simple("timestamp/x-lightfield-capture");
        const auto* meta = gst_buffer_get_reference_timestamp_meta(GST_PAD_PROBE_INFO_BUFFER(info), reference);
        gst_caps_unref(reference);
        GstElement* element = gst_pad_get_parent_element(at);
        GstClock* clock = gst_element_get_clock(element);
        const GstClockTimeDiff age = meta && clock ? GST_CLOCK_DIFF(meta->timestamp, gst_clock_get_time(clock))
                                                   : -static_cast<gint64>(GST_SECOND);
        if (age < -static_cast<gint64>(GST_SECOND / 10) || age > static_cast<gint64>(3 * GST_SECOND)) wrong++;
        gst_object_unref(clock);
        gst_object_unref(element);
        frames++;
        return GST_PAD_PROBE_OK;
      },
      nullptr, nullptr);
  gst_object_unref(pad);
  for (int i = 0; i < 600 && frames < 10; ++i) g_usleep(50000);
  EXPECT_GE(frames, 10);
  EXPECT_EQ(wrong, 0);
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
}

TEST_F(RtspTest, JpegStaysJpegWhereItIsNotDecoded) {
  const ElementPtr pipeline =
      launch("lfcamsrc decode=false latency=50000000 num-frames=5 rig=" + rig("/jpeg") + " ! image/jpeg ! fakesink");
  ASSERT_TRUE(pipeline);
  EXPECT_EQ(run(pipeline.get()), "");
}

TEST_F(RtspTest, ErrorsNameThePlace) {
  EXPECT_THAT(CameraPipeline("rig=" + rig("/jpeg", 66)).play(),
              HasSubstr(server->uri("/jpeg") + ": the picture is 64x48, the rig says 66x48"));
  EXPECT_THAT(CameraPipeline("rig=" + rig("/nothing")).play(),
              HasSubstr("camera 0 (cam_0): " + server->uri("/nothing")));
}

// Another client of the camera knows what it gives.
TEST_F(RtspTest, ANodeRecordsCodedPicturesAsTheyCome) {
  if (CameraFiles::h264_encoder().empty()) GTEST_SKIP() << "no encoder and decoder of H.264 are installed";
  const TempDir dir;
  const std::string other = dir / "other.mkv", folder = dir / "recording";
  const ElementPtr client = launch("rtspsrc latency=50 location=" + server->uri("/h264") +
                                   " ! rtph264depay ! h264parse ! matroskamux ! filesink location=" + other);
  const ElementPtr pipeline = launch("lfcameranode name=n is-live=true latency=50000000 rig=" + rig("/h264") +
                                     " record=" + folder + " ! fakesink async=false");
  const ElementPtr node(gst_bin_get_by_name(GST_BIN(pipeline.get()), "n"));
  const auto size = [&](const std::string& file) {
    std::error_code error;
    const auto bytes = std::filesystem::file_size(file, error);
    return error ? 0 : bytes;
  };
  gst_element_set_state(client.get(), GST_STATE_PLAYING);
  EXPECT_TRUE(eventually([&] { return size(other) > 1000; })) << "the other client has pictures first";
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  EXPECT_TRUE(eventually([&] { return size(folder + "/camera0.mkv") >= 3000; }));
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  gst_element_send_event(client.get(), gst_event_new_eos());
  const std::unique_ptr<GstBus, Unref<gst_object_unref>> bus(gst_element_get_bus(client.get()));
  GstMessage* end = gst_bus_timed_pop_filtered(bus.get(), 60 * GST_SECOND, GST_MESSAGE_EOS);
  EXPECT_TRUE(end);
  gst_clear_message(&end);
  gst_element_set_state(client.get(), GST_STATE_NULL);
  const RecordedFile recorded = read_recorded(folder + "/camera0.mkv");
  const auto came = slices_of(read_recorded(other)), kept = slices_of(recorded);
  ASSERT_GT(kept.size(), 10u) << came.size();
  EXPECT_EQ(recorded.kind, "video/x-h264");
  EXPECT_TRUE(recorded.keys[0]);
  // Pictures of one colour have the same bytes time and again: the recording begins with one of those that are alike.
  size_t most = 0;
  for (size_t begin = 0; begin < came.size(); begin++) {
    const size_t common = std::min(kept.size(), came.size() - begin);
    if (std::equal(kept.begin(), kept.begin() + static_cast<ptrdiff_t>(common),
                   came.begin() + static_cast<ptrdiff_t>(begin)))
      most = std::max(most, common);
  }
  EXPECT_GT(most, 10u);
}

// A node of a network camera, which is late, and a film: both are in the picture.
TEST_F(RtspTest, BesideAFilmInOneNode) {
  const std::string rig = files->save(
      "mixed.json", 2, [](Camera& camera) { camera.source = camera.id == 0 ? server->uri("/jpeg") : "mjpeg.mkv"; });
  const ElementPtr pipeline =
      launch("lfviewrequest is-live=true framerate=15/1 capture-delay=400000000 rig=" + rig +
             " ! lfcameranode name=n is-live=true loop=true latency=100000000 rig=" + rig + " ! fakesink");
  ASSERT_TRUE(pipeline);
  ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  const ElementPtr node(gst_bin_get_by_name(GST_BIN(pipeline.get()), "n"));
  uint64_t whole = 0, answers = 0, missing = 0;
  for (int i = 0; i < 300 && whole < 10; ++i) {  // answers with a frame of both cameras
    const uint64_t missing_now = stat(node.get(), "missing-frames"), answers_now = stat(node.get(), "answers");
    if (missing_now == missing) whole += answers_now - answers;
    missing = missing_now;
    answers = answers_now;
    g_usleep(50000);
  }
  EXPECT_GE(whole, 10u);
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
}

}  // namespace
}  // namespace lf::test
